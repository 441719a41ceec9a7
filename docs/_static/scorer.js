// How the search ranks: a title that contains the whole query comes before pages that contain its words. The other
// numbers are those of Sphinx, whose script declares the same variable: hence `var`.
var Scorer = {
  score: ([, , , , score, , kind]) => (kind === "title" ? score + 50 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};

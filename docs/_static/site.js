// A page from disk may not fetch a file: the search then shows titles alone, without the text around the words.
if (location.protocol === "file:" && typeof DOCUMENTATION_OPTIONS !== "undefined") {
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
}

// The list of versions in the sidebar: versions.js, beside the folders of the versions, names them, as one script for
// all, so that an old version shows the newer ones. It is a script, for a page from disk may not fetch a file.
document.addEventListener("DOMContentLoaded", () => {
  const place = document.querySelector(".versions");
  if (!place || typeof RMRC_VERSIONS === "undefined") return;
  const root = document.documentElement.dataset.content_root || "./";
  for (const version of RMRC_VERSIONS) {
    const link = document.createElement("a");
    link.href = `${root}../${version}/docs/index.html`;
    link.textContent = version;
    if (version === place.dataset.version) link.setAttribute("aria-current", "true");
    place.append(" ", link);
  }
});

// A button copies a command: of a block, or of a row of the textbook.
document.addEventListener("DOMContentLoaded", () => {
  for (const code of document.querySelectorAll(".highlight-sh pre, .highlight-python pre, tr[id] td:nth-child(3) code")) {
    const text = code.textContent.trim();
    const button = document.createElement("button");
    button.className = "copy";
    button.textContent = "copy";
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(text);
      button.textContent = "copied";
    });
    code.after(button);
  }
});

/* Hold the pose of the start, and move the site by a twist of 0.05 m/s along x for half a second. */
#include <stdio.h>
#include <string.h>

#include "law.h"

int main(void) {
  static rmrc_law_state state;
  double q[RMRC_LAW_JOINTS] = {$start};
  double qdot[RMRC_LAW_JOINTS], pose[7], twist[6] = {0.05, 0, 0, 0, 0, 0}, still[6] = {0};
  double time = 0.0;
  rmrc_law_init(&state);

  /* Without a target the law only finds the pose. */
  rmrc_law_step(&state, q, NULL, NULL, NULL, 0.0, qdot);
  memcpy(pose, state.words + RMRC_LAW_POSE, sizeof pose);

  while (time < 1.0) {
    int moves = time < 0.5;
    int64_t status = rmrc_law_step(&state, q, NULL, pose, moves ? twist : still, 0.0, qdot);
    if (status & RMRC_LAW_INVALID_INPUT) {
      fprintf(stderr, "invalid input at %g s\n", time);
      return 1;
    }

    /* The robot, which is here a robot that obeys exactly. */
    for (int j = 0; j < RMRC_LAW_JOINTS; j++) q[j] += RMRC_LAW_PERIOD * qdot[j];

    /* Where the law slows the target down, it advances by less than a period. */
    double way = RMRC_LAW_PERIOD * state.words[RMRC_LAW_PATH_RATE];
    if (moves) pose[0] += 0.05 * way;
    time += RMRC_LAW_PERIOD;
  }
  for (int j = 0; j < RMRC_LAW_JOINTS; j++) printf("%.17g\n", q[j]);
  return 0;
}

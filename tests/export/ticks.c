/* Read the input of steps from stdin, and write rates and status to stdout; tell the processor time of the worst step. */
#include <stdio.h>
#include <time.h>

#include "law.h"

enum { N = RMRC_LAW_JOINTS };

int main(void) {
  static rmrc_law_state state;
  struct {
    double q[N], qdot[N], pose[7], twist[6], dt, has_qdot, has_pose, has_twist;
  } in;
  struct {
    double qdot[N];
    int64_t status;
  } out;
  struct timespec before, after;
  double worst = 0.0, total = 0.0, ticks = 0.0;
  rmrc_law_init(&state);
  while (fread(&in, sizeof in, 1, stdin) == 1) {
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &before);
    out.status = rmrc_law_step(&state, in.q, in.has_qdot ? in.qdot : 0, in.has_pose ? in.pose : 0,
                               in.has_twist ? in.twist : 0, in.dt, out.qdot);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &after);
    double ns = 1e9 * (double)(after.tv_sec - before.tv_sec) + (double)(after.tv_nsec - before.tv_nsec);
    worst = ns > worst ? ns : worst;
    total += ns;
    ticks++;
    fwrite(&out, sizeof out, 1, stdout);
  }
  fprintf(stderr, "worst %.0f ns, mean %.0f ns of %.0f steps\n", worst, total / ticks, ticks);
  return 0;
}

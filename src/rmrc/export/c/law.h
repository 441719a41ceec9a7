/* The control law of the scenario $name, by rmrc $version, for $arm with $n joints: $joints.
 *
 * One state is one arm. It holds all memory of the law. No function allocates, reads a clock, or touches
 * anything but its arguments; states in different threads are independent of each other. Set no word by
 * yourself. Lengths are in m and angles in rad; rates of sliding joints are in m/s. */
#ifndef RMRC_LAW_H
#define RMRC_LAW_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { RMRC_LAW_JOINTS = $n, RMRC_LAW_WORDS = $words };

typedef struct {
  double words[RMRC_LAW_WORDS];
} rmrc_law_state;

/* The nominal time between two steps [s]. */
#define RMRC_LAW_PERIOD $period

/* Where the state holds what a step found, as indices of its words. */
enum {
$places
};

/* Bits of the status. */
enum {
$statuses
};

/* Forget all steps: the next one is the first, from rest. Call it before the first step. */
void rmrc_law_init(rmrc_law_state *state);

/* Write the rates for the next period into qdot_cmd; return the status.
 *
 * q          positions of the joints, as measured
 * qdot       rates, as measured; give them at each step, or NULL at each
 * pose_ref   target pose of the site in the world [x y z, quat w x y z]; NULL: no feedback
 * twist_ref  target twist along the axes of the world [v, omega]; NULL: none
 * dt         time since the last step [s]; 0: one period
 *
 * Input that is not finite, or no rotation, brakes the joints within all limits and sets INVALID_INPUT. */
int64_t rmrc_law_step(rmrc_law_state *state, const double *q, const double *qdot, const double *pose_ref,
                      const double *twist_ref, double dt, double *qdot_cmd);

#ifdef __cplusplus
}
#endif

#endif

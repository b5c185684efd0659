/* SPDX-License-Identifier: Apache-2.0
 *
 * The least that a loop can do: sleep to absolute deadlines, and note in [ns] how late each began.
 */
#include <stdint.h>
#include <time.h>

static int64_t now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return INT64_C(1000000000) * t.tv_sec + t.tv_nsec;
}

__attribute__((visibility("default"))) void sleep_to_deadlines(int64_t period, int64_t ticks, int64_t* late) {
  int64_t deadline = now();
  for (int64_t i = 0; i < ticks; ++i) {
    deadline += period;
    const struct timespec until = {deadline / INT64_C(1000000000), deadline % INT64_C(1000000000)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL)) continue;
    late[i] = now() - deadline;
  }
}

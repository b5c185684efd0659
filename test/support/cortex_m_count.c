/* SPDX-License-Identifier: Apache-2.0
 *
 * Counts the instructions of a call on a simulated Cortex-M, whose clock of 25 MHz ticks every 40 instructions where each
 * takes a nanosecond. Required definitions: HEADER (of the library), SCALAR, CALL.
 */
#include <stdint.h>
#include <stdio.h>

#include HEADER

#define SYSTICK ((volatile uint32_t*)0xE000E010) /* control, where it begins, where it is: it counts down */
#define TIMES 100
#define INSTRUCTIONS 40

static SCALAR q[32] = {0.1f, 0.2f, 0.3f, -1.0f, 0.5f, 0.6f, 0.7f}, v[32] = {1.0f, 1.0f, 1.0f, 1.0f}, a[32] = {1.0f}, tau[32];

int main(void) {
  SYSTICK[1] = 0xFFFFFF;
  SYSTICK[2] = 0;
  SYSTICK[0] = 5;
  while (!SYSTICK[2]);
  const uint32_t begin = SYSTICK[2];
  for (int k = 0; k < TIMES; ++k) CALL;
  const uint32_t ticks = (begin - SYSTICK[2]) & 0xFFFFFF;
  printf("%lu\n", (unsigned long)(ticks * INSTRUCTIONS / TIMES));
  return 0;
}

/* SPDX-License-Identifier: Apache-2.0
 *
 * Begins a program on a Cortex-M board: the vectors of the processor, and its floating-point unit.
 */
#include <stdint.h>

#define CPACR (*(volatile uint32_t*)0xE000ED88) /* access to coprocessors */

void _start(void);

static void reset(void) {
  CPACR |= 0xFu << 20;
  _start();
}

static void fault(void) { for (;;); }

/* The end of the board's memory for data, and what to do at a reset and at faults. */
__attribute__((section(".vectors"))) void (*const vectors[7])(void) = {
    (void (*)(void))0x20400000, reset, fault, fault, fault, fault, fault};

/* SPDX-License-Identifier: Apache-2.0
 *
 * What ticks report.
 */

#pragma once

/* Why a tick could not be computed. Python: Trouble. */
enum trouble { NONE, NUMBERS, UNDETERMINED, INSIDE };

/* Totals over ticks. Python: EventReport. */
typedef struct {
  double impact_loss; /* energy lost in impacts */
  long long impacts;
  long long trouble;      /* reason of the last failure */
  long long time_stepped; /* number of time-stepped ticks */
} report_t;

/* SPDX-License-Identifier: Apache-2.0
 *
 * Likewise, what an exported functional mock-up unit defines.
 */
#pragma once
#define PERIOD 1e-3
#define JOINTS 1
#define PARAMETERS 1
#define NAMES "payload[0]"
#define DEFAULTS {0.0}
#define TOKEN ""
#define FRAMES 1
#define JACOBIANS NULL
#define EXTERNAL 0

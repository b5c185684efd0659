/* SPDX-License-Identifier: Apache-2.0
 *
 * A generated function for other compiled code. Python reads this header, see header.py.
 */
#pragma once

/* Functions that Python calls: without the interpreter lock, and with it, since they take less time than others would
 * that were let run meanwhile. */
#define EXPORT __attribute__((visibility("default")))
#define QUICK EXPORT

/* A function with the signature of CasADi's C functions, and the memory it is bound to: pointers to its inputs and
 * outputs, and its workspace. */
typedef struct {
  int (*function)(const double**, double**, long long*, double*, int);
  const double** arguments;
  double** results;
  long long* integers;
  double* reals;
} entry_t;

/* SPDX-License-Identifier: Apache-2.0
 *
 * States and commands of Python in C.
 */
#pragma once
#include "python_function.h"

/* Fields of a state. Python: State. */
enum { TIME, STEP, Q, V, Z, ERROR, TIME_STEPPED, FIELDS };

/* The class of states with the places of its fields, and the numbers of q and v, and of z. */
typedef struct {
  PyTypeObject* type;
  Py_ssize_t place[FIELDS];
  npy_intp joints, internal;
} state_t;

/* 0 with an exception if the fields of the class are not slots. */
static int find_fields(PyObject* type, npy_intp joints, npy_intp internal, state_t* state) {
  static const char* const field[FIELDS] = {"time", "step", "q", "v", "z", "error", "time_stepped"};
  state->type = (PyTypeObject*)type;
  state->joints = joints;
  state->internal = internal;
  for (int i = 0; i < FIELDS; ++i) {
    PyObject* const member = PyObject_GetAttrString(type, field[i]);
    if (!member) return 0;
    if (!Py_IS_TYPE(member, &PyMemberDescr_Type)) {
      Py_DECREF(member);
      PyErr_Format(PyExc_TypeError, "%s is not a slot", field[i]);
      return 0;
    }
    state->place[i] = ((PyMemberDescrObject*)member)->d_member->offset;
    Py_DECREF(member);
  }
  return 1;
}

static PyObject** field_of(const state_t* of, PyObject* state, int field) {
  return (PyObject**)((char*)state + of->place[field]);
}

/* Read finite numbers from an array of doubles or a list of floats: 0 if it is anything else. */
static int read_numbers(PyObject* values, npy_intp count, double* to) {
  if (!PyList_CheckExact(values)) {
    const double* const x = numbers(values, count);
    if (x) memcpy(to, x, (size_t)count * sizeof *x);
    return x != NULL;
  }
  int plain = PyList_GET_SIZE(values) == count;
  for (npy_intp i = 0; plain && i < count; ++i) {
    PyObject* const one = PyList_GET_ITEM(values, i);
    plain = PyFloat_CheckExact(one);
    if (plain) to[i] = PyFloat_AS_DOUBLE(one);
  }
  return plain && all_finite(to, count);
}

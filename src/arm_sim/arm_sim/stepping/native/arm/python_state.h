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
} state_class_t;

/* Find the fields of the class of states: 0 with an exception if they are not slots, or NumPy cannot be used. */
static int find_fields(PyObject* type, npy_intp joints, npy_intp internal, state_class_t* state) {
  static const char* const field[FIELDS] = {"time", "step", "q", "v", "z", "error", "time_stepped"};
  if (!PyArray_API && _import_array() < 0) return 0;
  state->type = (PyTypeObject*)type;
  state->joints = joints;
  state->internal = internal;
  for (int i = 0; i < FIELDS; ++i) {
    PyObject* const member = PyObject_GetAttrString(type, field[i]);
    if (!member) return 0;
    const int is_slot = Py_IS_TYPE(member, &PyMemberDescr_Type);
    if (is_slot) state->place[i] = ((PyMemberDescrObject*)member)->d_member->offset;
    else PyErr_Format(PyExc_TypeError, "%s is not a slot", field[i]);
    Py_DECREF(member);
    if (!is_slot) return 0;
  }
  return 1;
}

/* Where a state has one of its fields. */
static PyObject** field_of(const state_class_t* layout, PyObject* state, int field) {
  return (PyObject**)((char*)state + layout->place[field]);
}

/* Read finite numbers from an array of doubles or a list of floats: 0 if it is anything else. */
static int read_numbers(PyObject* values, npy_intp count, double* to) {
  if (!PyList_CheckExact(values)) {
    const double* const x = numbers(values, count);
    if (x) memcpy(to, x, (size_t)count * sizeof *x);
    return x != NULL;
  }
  int is_list_of_floats = PyList_GET_SIZE(values) == count;
  for (npy_intp i = 0; is_list_of_floats && i < count; ++i) {
    PyObject* const one = PyList_GET_ITEM(values, i);
    is_list_of_floats = PyFloat_CheckExact(one);
    if (is_list_of_floats) to[i] = PyFloat_AS_DOUBLE(one);
  }
  return is_list_of_floats && all_finite(to, count);
}

/* SPDX-License-Identifier: Apache-2.0
 *
 * The compiled tick as a Python function of a command: it checks the command, and returns a new state.
 */
#include "arm.h"
#include "entry.h"
#include "python_state.h"

/* An arm, and its states. */
typedef struct {
  arm_t* arm;
  state_class_t state;
} python_arm_t;

/* A new array of numbers, to be read only. */
static PyObject* copy_of(const double* x, npy_intp count) {
  PyArrayObject* const array = (PyArrayObject*)PyArray_SimpleNew(1, &count, NPY_DOUBLE);
  if (!array) return NULL;
  memcpy(PyArray_DATA(array), x, (size_t)count * sizeof *x);
  PyArray_CLEARFLAGS(array, NPY_ARRAY_WRITEABLE);
  return (PyObject*)array;
}

/* The state after the last tick, which was the `count`-th. */
static PyObject* state_of(const python_arm_t* own, long long count) {
  const double *x = own->arm->x, *notes = own->arm->notes;
  const npy_intp joints = own->state.joints;
  PyObject* const state = own->state.type->tp_alloc(own->state.type, 0);
  if (!state) return NULL;
  PyObject* const value[FIELDS] = {
      PyFloat_FromDouble((double)count * own->arm->dt),
      PyLong_FromLongLong(count),
      copy_of(x, joints),
      copy_of(x + joints, joints),
      copy_of(x + 2 * joints, own->state.internal),
      PyFloat_FromDouble(notes[0]),
      PyLong_FromDouble(notes[1]),
  };
  int is_complete = 1;
  for (int i = 0; i < FIELDS; ++i) {
    *field_of(&own->state, state, i) = value[i];
    is_complete &= value[i] != NULL;
  }
  if (is_complete) return state;
  Py_DECREF(state);
  return NULL;
}

/* Advance by the tick after some others under a command, and return the state; False if it cannot be computed, and None if
 * the command is not plain numbers, which is left to Python. */
static PyObject* advance(PyObject* capsule, PyObject* const* arguments, Py_ssize_t count) {
  const python_arm_t* const own = PyCapsule_GetPointer(capsule, NULL);
  const int is_valid = count == 2 && read_numbers(arguments[0], own->state.joints, own->arm->command);
  const long long before = is_valid ? PyLong_AsLongLong(arguments[1]) : -1;
  if (before < 0) { /* or too large for this type */
    PyErr_Clear();
    Py_RETURN_NONE;
  }
  PyThreadState* const thread = PyEval_SaveThread(); /* without the lock, as events may make a tick long */
  const int computed = own->arm->tick(own->arm);
  PyEval_RestoreThread(thread);
  if (!computed) Py_RETURN_FALSE;
  return state_of(own, before + 1);
}

/* The function for a tick of an arm; `kept` keeps its memory. */
EXPORT PyObject* python_function(arm_t* arm, Py_ssize_t joints, Py_ssize_t internal, PyObject* state, PyObject* kept) {
  static PyMethodDef method = {"advance", (PyCFunction)(void (*)(void))advance, METH_FASTCALL, NULL};
  python_arm_t own = {.arm = arm};
  if (!find_fields(state, joints, internal, &own.state)) return NULL;
  return bound_function(&method, &own, sizeof own, kept);
}

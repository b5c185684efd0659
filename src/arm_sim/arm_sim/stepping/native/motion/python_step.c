/* SPDX-License-Identifier: Apache-2.0
 *
 * The compiled tick as a Python function of a command: it checks the command, and returns a new state.
 */
#include "python_function.h"

#include "entry.h"
#include "step.h"

/* Fields of a state. Python: State. */
enum { TIME, STEP, Q, V, Z, ERROR, TIME_STEPPED, FIELDS };
static const char* const field[FIELDS] = {"time", "step", "q", "v", "z", "error", "time_stepped"};

/* A tick of one step, and the class of states with the places of its fields. */
typedef struct {
  step_t tick;
  npy_intp joints, internal; /* numbers of q and v, and of z */
  PyTypeObject* state;
  Py_ssize_t place[FIELDS];
} arm_t;

/* A new array of numbers, to be read only. */
static PyObject* copy_of(const double* x, npy_intp count) {
  PyArrayObject* const array = (PyArrayObject*)PyArray_SimpleNew(1, &count, NPY_DOUBLE);
  if (!array) return NULL;
  memcpy(PyArray_DATA(array), x, (size_t)count * sizeof *x);
  PyArray_CLEARFLAGS(array, NPY_ARRAY_WRITEABLE);
  return (PyObject*)array;
}

/* The state after the last tick, which was the `count`-th. */
static PyObject* state_of(const arm_t* arm, long long count) {
  const double *x = arm->tick.x, *notes = arm->tick.notes;
  PyObject* const state = arm->state->tp_alloc(arm->state, 0);
  if (!state) return NULL;
  PyObject* const value[FIELDS] = {
      PyFloat_FromDouble((double)count * arm->tick.dt),
      PyLong_FromLongLong(count),
      copy_of(x, arm->joints),
      copy_of(x + arm->joints, arm->joints),
      copy_of(x + 2 * arm->joints, arm->internal),
      PyFloat_FromDouble(notes[0]),
      PyLong_FromDouble(notes[1]),
  };
  int whole = 1;
  for (int i = 0; i < FIELDS; ++i) {
    *(PyObject**)((char*)state + arm->place[i]) = value[i];
    whole &= value[i] != NULL;
  }
  if (whole) return state;
  Py_DECREF(state);
  return NULL;
}

/* Read finite numbers from an array of doubles or a list of floats: 0 if it is anything else. */
static int read_numbers(PyObject* given, npy_intp count, double* to) {
  if (!PyList_CheckExact(given)) {
    const double* const x = numbers(given, count);
    if (x) memcpy(to, x, (size_t)count * sizeof *x);
    return x != NULL;
  }
  int plain = PyList_GET_SIZE(given) == count;
  for (npy_intp i = 0; plain && i < count; ++i) {
    PyObject* const one = PyList_GET_ITEM(given, i);
    plain = PyFloat_CheckExact(one);
    if (plain) to[i] = PyFloat_AS_DOUBLE(one);
  }
  return plain && all_finite(to, count);
}

/* Take the tick without the interpreter lock, as events may make it long: 0 if it cannot be computed. */
static int take(const step_t* tick) {
  PyThreadState* const state = PyEval_SaveThread();
  const long long done = tick->roll(tick->scene, tick->x, tick->command, tick->stride, tick->p, tick->dt, tick->ticks,
                                    tick->trace, tick->effort, tick->notes, tick->control, tick->report);
  PyEval_RestoreThread(state);
  return done == tick->ticks;
}

/* Advance by the tick after some others under a command, and return the state; False if it cannot be computed, and None if
 * the command is not plain numbers, which is left to Python. */
static PyObject* advance(PyObject* capsule, PyObject* const* given, Py_ssize_t count) {
  const arm_t* const arm = PyCapsule_GetPointer(capsule, NULL);
  const step_t* const tick = &arm->tick;
  const int plain = count == 2 && read_numbers(given[0], arm->joints, tick->command);
  const long long before = plain ? PyLong_AsLongLong(given[1]) : -1;
  if (before < 0) { /* or too large for this type */
    PyErr_Clear();
    Py_RETURN_NONE;
  }
  if (!take(tick)) Py_RETURN_FALSE;
  return state_of(arm, before + 1);
}

/* The function for a tick of an arm; `kept` keeps its memory. */
EXPORT PyObject* python_function(const step_t* tick, Py_ssize_t joints, Py_ssize_t internal, PyObject* state, PyObject* kept) {
  static PyMethodDef method = {"advance", (PyCFunction)(void (*)(void))advance, METH_FASTCALL, NULL};
  if (!PyArray_API && _import_array() < 0) return NULL;
  arm_t arm = {*tick, joints, internal, (PyTypeObject*)state, {0}};
  for (int i = 0; i < FIELDS; ++i) {
    PyObject* const member = PyObject_GetAttrString(state, field[i]);
    if (!member) return NULL;
    if (!Py_IS_TYPE(member, &PyMemberDescr_Type)) return PyErr_Format(PyExc_TypeError, "%s is not a slot", field[i]);
    arm.place[i] = ((PyMemberDescrObject*)member)->d_member->offset;
    Py_DECREF(member);
  }
  return bound_function(&method, &arm, sizeof arm, kept);
}

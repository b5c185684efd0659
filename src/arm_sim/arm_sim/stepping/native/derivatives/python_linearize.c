/* SPDX-License-Identifier: Apache-2.0
 *
 * Derivatives of a tick as a Python function of a state and a command: it checks them, and returns a new matrix.
 */
#include "entry.h"
#include "linearize.h"
#include "python_state.h"

/* What derivatives take, and the class of states. */
typedef struct {
  linearize_t tick;
  state_class_t state;
} linearizer_t;

/* Derivatives by the state and by the command, side by side; None if there are none, or the arguments are not a state and
 * plain numbers: this is left to Python. */
static PyObject* linearize(PyObject* capsule, PyObject* const* arguments, Py_ssize_t count) {
  const linearizer_t* const own = PyCapsule_GetPointer(capsule, NULL);
  const linearize_t* const tick = &own->tick;
  const state_class_t* const state = &own->state;
  const npy_intp n = state->joints, nz = state->internal, nx = 2 * n + nz;
  double x[nx], r[n], after[nx];
  if (count != 2 || !Py_IS_TYPE(arguments[0], state->type)) Py_RETURN_NONE;
  if (!read_numbers(*field_of(state, arguments[0], Q), n, x) || !read_numbers(*field_of(state, arguments[0], V), n, x + n))
    Py_RETURN_NONE;
  if (!read_numbers(*field_of(state, arguments[0], Z), nz, x + 2 * n) || !read_numbers(arguments[1], n, r)) Py_RETURN_NONE;
  PyObject* const slopes = PyArray_SimpleNew(2, ((npy_intp[]){nx, nx + n}), NPY_DOUBLE);
  if (!slopes) return NULL;
  double* const to = PyArray_DATA((PyArrayObject*)slopes);
  PyThreadState* const thread = PyEval_SaveThread();
  const int computed = tick->differentiate(tick->scene, tick->tangents, tick->engine, x, r, tick->p, tick->dt, after, to);
  PyEval_RestoreThread(thread);
  if (computed) return slopes;
  Py_DECREF(slopes);
  Py_RETURN_NONE;
}

/* The function for an arm; `kept` keeps its memory. */
EXPORT PyObject* python_function(const linearize_t* tick, Py_ssize_t joints, Py_ssize_t internal, PyObject* state,
                                 PyObject* kept) {
  static PyMethodDef method = {"linearize", (PyCFunction)(void (*)(void))linearize, METH_FASTCALL, NULL};
  linearizer_t own = {.tick = *tick};
  if (!find_fields(state, joints, internal, &own.state)) return NULL;
  return bound_function(&method, &own, sizeof own, kept);
}

/* SPDX-License-Identifier: Apache-2.0
 *
 * A generated function of vectors of one length as a Python function: it checks its arguments, and returns a new array.
 *
 * Between Python and the function are no conversions, which take longer than the dynamics of an arm.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>

#include "entry.h"

/* A function bound to its memory, which `kept` keeps alive. */
typedef struct {
  entry_t entry;
  Py_ssize_t arguments;
  npy_intp size; /* of each argument */
  int rank;      /* of the result, whose dimensions are `shape` */
  npy_intp shape[2];
  PyObject* kept;
} bound_t;

/* Whether all numbers are finite: 0 times any other is not a number, and neither is a sum with it. */
static int all_finite(const double* x, npy_intp count) {
  double zero = 0.0;
  for (npy_intp i = 0; i < count; ++i) zero += 0.0 * x[i];
  return zero == 0.0;
}

/* The numbers of an array of `size` finite doubles one after another; NULL of anything else. */
static const double* numbers(PyObject* given, npy_intp size) {
  PyArrayObject* const array = (PyArrayObject*)given;
  if (!PyArray_CheckExact(given) || PyArray_NDIM(array) != 1 || PyArray_DIM(array, 0) != size) return NULL;
  if (PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISCARRAY_RO(array)) return NULL;
  const double* const x = PyArray_DATA(array);
  return all_finite(x, size) ? x : NULL;
}

/* The result for vectors; None where an argument is anything else or a result is not finite, which is left to Python. */
static PyObject* answer(PyObject* capsule, PyObject* const* given, Py_ssize_t count) {
  bound_t* const bound = PyCapsule_GetPointer(capsule, NULL);
  if (count != bound->arguments) Py_RETURN_NONE;
  for (Py_ssize_t i = 0; i < count; ++i)
    if (!(bound->entry.arguments[i] = numbers(given[i], bound->size))) Py_RETURN_NONE;
  PyArrayObject* const result = (PyArrayObject*)PyArray_SimpleNew(bound->rank, bound->shape, NPY_DOUBLE);
  if (!result) return NULL;
  const entry_t* const f = &bound->entry;
  f->results[0] = PyArray_DATA(result);
  f->function(f->arguments, f->results, f->integers, f->reals, 0);
  if (all_finite(f->results[0], PyArray_SIZE(result))) return (PyObject*)result;
  Py_DECREF(result);
  Py_RETURN_NONE;
}

static void release(bound_t* bound) {
  Py_DECREF(bound->kept);
  PyMem_Free(bound);
}

static void release_capsule(PyObject* capsule) { release(PyCapsule_GetPointer(capsule, NULL)); }

/* The function `entry` of `arguments` vectors with `size` numbers each; its result has the dimensions of `shape`. */
EXPORT PyObject* python_function(const entry_t* entry, Py_ssize_t arguments, Py_ssize_t size, int rank, const npy_intp* shape,
                                 PyObject* kept) {
  static PyMethodDef method = {"answer", (PyCFunction)(void (*)(void))answer, METH_FASTCALL, NULL};
  if (!PyArray_API && _import_array() < 0) return NULL;
  bound_t* const bound = PyMem_Malloc(sizeof *bound);
  if (!bound) return PyErr_NoMemory();
  *bound = (bound_t){*entry, arguments, size, rank, {shape[0], shape[rank - 1]}, kept};
  Py_INCREF(kept);
  PyObject* const capsule = PyCapsule_New(bound, NULL, release_capsule);
  if (!capsule) {
    release(bound);
    return NULL;
  }
  PyObject* const function = PyCFunction_New(&method, capsule);
  Py_DECREF(capsule);
  return function;
}

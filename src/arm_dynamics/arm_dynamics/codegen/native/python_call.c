/* SPDX-License-Identifier: Apache-2.0
 *
 * A generated function of vectors of one length as a Python function: it checks its arguments, and returns a new array.
 */
#include "python_function.h"

#include "entry.h"

/* A function and its memory. */
typedef struct {
  entry_t entry;
  Py_ssize_t arguments;
  npy_intp size; /* of each argument */
  int rank;      /* of the result, whose dimensions are `shape` */
  npy_intp shape[2];
} bound_t;

/* The result for vectors; None where an argument is anything else or a result is not finite, which is left to Python. */
static PyObject* answer(PyObject* capsule, PyObject* const* arguments, Py_ssize_t count) {
  bound_t* const bound = PyCapsule_GetPointer(capsule, NULL);
  if (count != bound->arguments) Py_RETURN_NONE;
  for (Py_ssize_t i = 0; i < count; ++i)
    if (!(bound->entry.arguments[i] = numbers(arguments[i], bound->size))) Py_RETURN_NONE;
  PyArrayObject* const result = (PyArrayObject*)PyArray_SimpleNew(bound->rank, bound->shape, NPY_DOUBLE);
  if (!result) return NULL;
  const entry_t* const f = &bound->entry;
  f->results[0] = PyArray_DATA(result);
  f->function(f->arguments, f->results, f->integers, f->reals, 0);
  if (all_finite(f->results[0], PyArray_SIZE(result))) return (PyObject*)result;
  Py_DECREF(result);
  Py_RETURN_NONE;
}

/* The function `entry` of `arguments` vectors with `size` numbers each; its result has the dimensions of `shape`. */
EXPORT PyObject* python_function(const entry_t* entry, Py_ssize_t arguments, Py_ssize_t size, int rank, const npy_intp* shape,
                                 PyObject* kept) {
  static PyMethodDef method = {"answer", (PyCFunction)(void (*)(void))answer, METH_FASTCALL, NULL};
  if (!PyArray_API && _import_array() < 0) return NULL;
  const bound_t bound = {*entry, arguments, size, rank, {shape[0], shape[rank - 1]}};
  return bound_function(&method, &bound, sizeof bound, kept);
}

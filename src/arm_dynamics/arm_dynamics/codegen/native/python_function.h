/* SPDX-License-Identifier: Apache-2.0
 *
 * Functions that Python calls without conversions, which take longer than the dynamics of an arm: what they share.
 */
#pragma once
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#define NPY_NO_DEPRECATED_API NPY_1_7_API_VERSION
#include <numpy/arrayobject.h>

#include <string.h>

/* Whether all numbers are finite: 0 times any other is not a number, and neither is a sum with it. */
static int all_finite(const double* x, npy_intp count) {
  double zero = 0.0;
  for (npy_intp i = 0; i < count; ++i) zero += 0.0 * x[i];
  return zero == 0.0;
}

/* The numbers of an array of `size` finite doubles one after another; NULL of anything else. */
static const double* numbers(PyObject* object, npy_intp size) {
  PyArrayObject* const array = (PyArrayObject*)object;
  if (!PyArray_CheckExact(object) || PyArray_NDIM(array) != 1 || PyArray_DIM(array, 0) != size) return NULL;
  if (PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISCARRAY_RO(array)) return NULL;
  const double* const x = PyArray_DATA(array);
  return all_finite(x, size) ? x : NULL;
}

static void release(PyObject* capsule) {
  PyMem_Free(PyCapsule_GetPointer(capsule, NULL));
  Py_DECREF((PyObject*)PyCapsule_GetContext(capsule));
}

/* A function of Python whose first argument is a capsule with a copy of `size` bytes; it keeps an object alive. */
static PyObject* bound_function(PyMethodDef* method, const void* memory, size_t size, PyObject* kept) {
  void* const own = PyMem_Malloc(size);
  if (!own) return PyErr_NoMemory();
  memcpy(own, memory, size);
  PyObject* const capsule = PyCapsule_New(own, NULL, NULL);
  if (!capsule) {
    PyMem_Free(own);
    return NULL;
  }
  Py_INCREF(kept);
  PyCapsule_SetContext(capsule, kept);
  PyCapsule_SetDestructor(capsule, release);
  PyObject* const function = PyCFunction_New(method, capsule);
  Py_DECREF(capsule);
  return function;
}

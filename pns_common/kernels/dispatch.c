/* Calls of compiled loops from Python.

   A loop is chosen by the dtypes, axes and layout of the arguments; where none suits, TypeError.
   A tuple stands for what it holds.
   The interpreter's lock is released while a loop runs. ahead.py writes loops.h, the table.
   Stable interface of Python 3.11 and of numpy: one module for all later versions of both. */

#define PY_SSIZE_T_CLEAN
#define NPY_NO_DEPRECATED_API NPY_1_22_API_VERSION
#define NPY_TARGET_VERSION NPY_1_22_API_VERSION
#include <Python.h>
#include <numpy/arrayobject.h>
#include <stdint.h>
#include <string.h>

/* What numba makes of a function: result, error, then its arguments; 0 where it ended well. */
typedef int32_t Entry(void *, void **, void **, int64_t *, double *);

typedef struct {
    const char *name;       /* module.function */
    const char *parameters; /* such as "f8_2d, u4_1d, int, float, bool, " */
    const char *result;     /* nothing, b, i, f, or ii */
    Entry *entry;
} Loop;

#include "loops.h"

enum { COUNT = sizeof LOOPS / sizeof *LOOPS, MOST = 32 };

typedef struct {
    void *arrays[MOST];
    int64_t wholes[3 * MOST];
    double fractions[MOST];
} Arguments;

/* 1: read; 0: of another type; -1: an exception is set. */
static int read_array(const char *wanted, PyObject *value, void **data, int64_t *shape)
{
    if (!PyArray_Check(value))
        return 0;
    PyArrayObject *array = (PyArrayObject *)value;
    const int axes = wanted[3] - '0';
    if (PyArray_NDIM(array) != axes || PyArray_DESCR(array)->kind != wanted[0]
        || PyArray_ITEMSIZE(array) != wanted[1] - '0' || !PyArray_ISCARRAY_RO(array))
        return 0;
    *data = PyArray_DATA(array);
    for (int axis = 0; axis < axes; axis++)
        shape[axis] = PyArray_DIM(array, axis);
    return 1;
}

static int read_whole(PyObject *value, int64_t *whole)
{
    if (!PyIndex_Check(value))
        return 0;
    PyObject *index = PyNumber_Index(value);
    if (index == NULL)
        return -1;
    *whole = PyLong_AsLongLong(index);
    Py_DECREF(index);
    return *whole == -1 && PyErr_Occurred() ? -1 : 1;
}

static int read_fraction(PyObject *value, double *fraction)
{
    if (!PyFloat_Check(value) && !PyIndex_Check(value) && !PyArray_IsScalar(value, Floating))
        return 0;
    *fraction = PyFloat_AsDouble(value);
    return *fraction == -1.0 && PyErr_Occurred() ? -1 : 1;
}

static int read_arguments(const char *wanted, PyObject *const *given, Py_ssize_t count, Arguments *to)
{
    void **array = to->arrays;
    int64_t *whole = to->wholes;
    double *fraction = to->fractions;
    for (Py_ssize_t i = 0; i < count; i++) {
        int read;
        if (*wanted == '\0')
            return 0;
        if (wanted[2] == '_') {
            read = read_array(wanted, given[i], array++, whole);
            whole += wanted[3] - '0';
        } else if (*wanted == 'f')
            read = read_fraction(given[i], fraction++);
        else if (*wanted == 'b') {
            read = PyBool_Check(given[i]) || PyArray_IsScalar(given[i], Bool);
            *whole++ = read && PyObject_IsTrue(given[i]);
        } else
            read = read_whole(given[i], whole++);
        if (read != 1)
            return read;
        wanted = strchr(wanted, ' ') + 1;
    }
    return *wanted == '\0';
}

static PyObject *no_loop(const Loop *loop, PyObject *const *given, Py_ssize_t count)
{
    PyObject *types = PyList_New(0), *offered = PyList_New(0);
    for (Py_ssize_t i = 0; types != NULL && i < count; i++) {
        PyObject *type = PyArray_Check(given[i])
            ? PyUnicode_FromFormat("%c%zd_%dd%s", PyArray_DESCR((PyArrayObject *)given[i])->kind,
                  (Py_ssize_t)PyArray_ITEMSIZE((PyArrayObject *)given[i]),
                  PyArray_NDIM((PyArrayObject *)given[i]),
                  PyArray_ISCARRAY_RO((PyArrayObject *)given[i]) ? "" : " (not C-contiguous)")
            : PyObject_GetAttrString((PyObject *)Py_TYPE(given[i]), "__name__");
        if (type == NULL || PyList_Append(types, type) < 0)
            Py_CLEAR(types);
        Py_XDECREF(type);
    }
    for (const Loop *at = loop; offered != NULL && at < LOOPS + COUNT; at++) {
        if (strcmp(at->name, loop->name) != 0)
            break;
        PyObject *type = PyUnicode_FromString(at->parameters);
        if (type == NULL || PyList_Append(offered, type) < 0)
            Py_CLEAR(offered);
        Py_XDECREF(type);
    }
    if (types != NULL && offered != NULL)
        PyErr_Format(PyExc_TypeError, "%s is compiled for %S, not for %S", loop->name, offered, types);
    Py_XDECREF(types);
    Py_XDECREF(offered);
    return NULL;
}

static PyObject *call(PyObject *self, PyObject *const *passed, Py_ssize_t passed_count)
{
    const Loop *first = PyCapsule_GetPointer(self, NULL), *loop = first;
    PyObject *given[MOST];
    Py_ssize_t count = 0;
    for (Py_ssize_t i = 0; i < passed_count; i++) {
        const int is_tuple = PyTuple_Check(passed[i]);
        const Py_ssize_t items = is_tuple ? PyTuple_Size(passed[i]) : 1;
        if (count + items > MOST)
            return no_loop(first, passed, passed_count);
        for (Py_ssize_t item = 0; item < items; item++)
            given[count++] = is_tuple ? PyTuple_GetItem(passed[i], item) : passed[i];
    }
    Arguments read;
    int suits = 0;
    if (first == NULL)
        return NULL;
    for (; loop < LOOPS + COUNT && strcmp(loop->name, first->name) == 0; loop++) {
        suits = read_arguments(loop->parameters, given, count, &read);
        if (suits < 0)
            return NULL;
        if (suits)
            break;
    }
    if (!suits)
        return no_loop(first, given, count);
    void *result = NULL, *error = NULL;
    int32_t status;
    Py_BEGIN_ALLOW_THREADS
    status = loop->entry(&result, &error, read.arrays, read.wholes, read.fractions);
    Py_END_ALLOW_THREADS
    /* numba's OK and "returned None". */
    if (status != 0 && status != -2)
        return PyErr_Format(PyExc_RuntimeError, "%s ended with status %d", loop->name, (int)status);
    if (strcmp(loop->result, "ii") == 0)
        return Py_BuildValue("LL", (long long)read.wholes[0], (long long)read.wholes[1]);
    if (*loop->result == 'b')
        return PyBool_FromLong(read.wholes[0] != 0);
    if (*loop->result == 'i')
        return PyLong_FromLongLong(read.wholes[0]);
    if (*loop->result == 'f')
        return PyFloat_FromDouble(read.fractions[0]);
    Py_RETURN_NONE;
}

static PyMethodDef METHODS[COUNT];

static int fill(PyObject *module)
{
    if (PyArray_ImportNumPyAPI() < 0)
        return -1;
    for (int i = 0; i < COUNT; i++) {
        if (i > 0 && strcmp(LOOPS[i].name, LOOPS[i - 1].name) == 0)
            continue;
        METHODS[i] = (PyMethodDef){LOOPS[i].name, (PyCFunction)(void (*)(void))call, METH_FASTCALL, NULL};
        PyObject *self = PyCapsule_New((void *)&LOOPS[i], NULL, NULL);
        PyObject *function = self == NULL ? NULL : PyCFunction_New(&METHODS[i], self);
        Py_XDECREF(self);
        if (function == NULL || PyModule_AddObjectRef(module, LOOPS[i].name, function) < 0)
            return -1;
        Py_DECREF(function);
    }
    return PyModule_AddStringConstant(module, "DIGEST", DIGEST);
}

static PyModuleDef_Slot SLOTS[] = {{Py_mod_exec, fill}, {0, NULL}};
static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT, .m_name = "compiled", .m_doc = "Loops, compiled.", .m_slots = SLOTS};

PyMODINIT_FUNC PyInit_compiled(void)
{
    return PyModuleDef_Init(&MODULE);
}

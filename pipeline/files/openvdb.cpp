#include <nanobind/nanobind.h>
NB_MODULE(_openvdb, m) {}

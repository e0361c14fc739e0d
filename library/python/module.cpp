// The extension module limn._limn: the library's headers for Python. The package limn shows its names as its
// own.
#include "library/python/calls.h"
#include "library/python/record.h"
#include "limn/version.h"

PYBIND11_MODULE(_limn, module) {
  namespace python = limn::python;
  // The classes are those of the package, in their names and for pickle.
  const pybind11::object name = module.attr("__name__");
  module.attr("__name__") = "limn";
  module.attr("__version__") = limn::version();
  python::add_errors(module);
  python::add_basics(module);
  python::add_log(module);
  python::add_rig(module);
  python::add_markers(module);
  python::add_bodies(module);
  python::add_calibration(module);
  python::add_renderer(module);
  module.attr("__name__") = name;
}

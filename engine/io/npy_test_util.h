#ifndef LITAGS_ENGINE_IO_NPY_TEST_UTIL_H_
#define LITAGS_ENGINE_IO_NPY_TEST_UTIL_H_

#include <string>
#include <vector>

namespace litags {

// What numpy.save writes for this header text, version 1 or 2, and data.
inline std::string NumpyFile(int version, const std::string& header, const std::string& data) {
  std::string out = "\x93NUMPY";
  out += static_cast<char>(version);
  out += '\0';
  for (int i = 0; i < (version == 1 ? 2 : 4); ++i) out += static_cast<char>(header.size() >> 8 * i);
  return out + header + data;
}

// `shape` as in "3, 4" or "5,".
inline std::string NumpyHeader(const std::string& descr, const std::string& shape,
                               const std::string& order = "False") {
  return "{'descr': '" + descr + "', 'fortran_order': " + order + ", 'shape': (" + shape +
         "), }          \n";
}

inline std::string NumpyFile(const std::string& shape, const std::vector<float>& values) {
  const char* data = reinterpret_cast<const char*>(values.data());
  return NumpyFile(1, NumpyHeader("<f4", shape), std::string(data, values.size() * sizeof(float)));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_NPY_TEST_UTIL_H_

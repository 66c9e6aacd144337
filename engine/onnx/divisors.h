// Works around a fault of OpenCV 4.6 in ONNX files.
#ifndef LITAGS_ENGINE_ONNX_DIVISORS_H_
#define LITAGS_ENGINE_ONNX_DIVISORS_H_

#include <string>

namespace litags {

// Gives each division of the model its own copy of its constant divisor. OpenCV 4.6 inverts the
// constant where it lies: one that divides twice, as the scale of LPIPS does, would be inverted
// twice and multiply. `model`: an ONNX file's bytes. False, with the model as it was, if they are
// not an ONNX file.
bool UnshareDivisors(std::string* model);

}  // namespace litags

#endif  // LITAGS_ENGINE_ONNX_DIVISORS_H_

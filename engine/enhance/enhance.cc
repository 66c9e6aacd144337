#include "engine/enhance/enhance.h"

namespace litags {

const std::vector<Enhancer>& BuiltinEnhancers() {
  static const auto* const kEnhancers = new std::vector<Enhancer>{
      {"gain", EnhanceGain},        {"light-gain", EnhanceLightGain}, {"gamma", EnhanceGamma},
      {"histeq", EnhanceHistogram}, {"clahe", EnhanceClahe},          {"lime", EnhanceLime}};
  return *kEnhancers;
}

}  // namespace litags

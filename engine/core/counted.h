// Numbers of things in sentences.
#ifndef LITAGS_ENGINE_CORE_COUNTED_H_
#define LITAGS_ENGINE_CORE_COUNTED_H_

#include <string>

#include "absl/strings/str_cat.h"

namespace litags {

// "1 photo", "2 photos"; `noun` is that of one thing, and takes an s for more.
template <class Number>
std::string Counted(Number count, const char* noun) {
  return absl::StrCat(count, " ", noun, count == 1 ? "" : "s");
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_COUNTED_H_

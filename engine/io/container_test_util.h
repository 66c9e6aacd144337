// For tests of files that another version of the program wrote.
#ifndef LITAGS_ENGINE_IO_CONTAINER_TEST_UTIL_H_
#define LITAGS_ENGINE_IO_CONTAINER_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <string>

#include "engine/io/container.h"

namespace litags {

// Writes the container file again, with the same sections, as one of another version.
inline void RewriteAsVersion(const std::string& path, const std::string& kind, uint32_t version) {
  const auto file = Container::Read(path, kind, 0, std::numeric_limits<uint32_t>::max());
  ASSERT_TRUE(file.ok()) << file.status();
  ContainerWriter out(kind, version);
  for (const std::string& name : file->SectionNames()) {
    out.AddSectionView(name, *file->Section(name));
  }
  ASSERT_TRUE(out.Commit(path).ok());
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_CONTAINER_TEST_UTIL_H_

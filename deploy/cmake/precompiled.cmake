# Headers that most files include, compiled once. Files still include what they use: the presets
# debug and fuzz build without this.
set(litags_common_headers
  <algorithm> <array> <chrono> <cmath> <cstdint> <cstdio> <cstring> <filesystem> <fstream>
  <functional>
  <map> <memory> <mutex> <optional> <set> <string> <string_view> <thread> <utility> <vector>
  [["absl/status/statusor.h"]] [["absl/strings/str_cat.h"]] [["absl/strings/str_format.h"]]
  [["absl/strings/str_join.h"]] [["absl/types/span.h"]])

# Some libraries ask for threads, and what uses a precompiled header must not differ in it. The
# other flag lets ccache see what a precompiled header holds.
target_compile_options(litags_flags INTERFACE
  -pthread $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)

# litags_precompile(NAME HEADERS headers... [FLAGS flags...] [DEPS deps...])
# For targets that say REUSE_FROM NAME. GCC wants the same flags of them, position independence too.
function(litags_precompile name)
  cmake_parse_arguments(ARG "" "" "HEADERS;FLAGS;DEPS" ${ARGN})
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/${name}.cc CONTENT "")
  add_library(${name} OBJECT ${PROJECT_BINARY_DIR}/${name}.cc)
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_link_libraries(${name} PRIVATE litags_flags ${ARG_DEPS})
  target_compile_options(${name} PRIVATE ${ARG_FLAGS})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
endfunction()

# In two thirds of the time of -O3: most of what tests take is their compilation.
set(litags_test_flags $<$<CONFIG:Release>:-O1>)

litags_precompile(litags_library_headers HEADERS ${litags_common_headers} FLAGS -fPIC)
litags_precompile(litags_program_headers HEADERS ${litags_common_headers} FLAGS -fPIE)
if(BUILD_TESTING)
  litags_precompile(litags_test_headers
    HEADERS ${litags_common_headers} <gmock/gmock.h> <gtest/gtest.h>
    FLAGS ${litags_test_flags} -fPIE
    DEPS GTest::gmock)
endif()

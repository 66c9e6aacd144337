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

# litags_precompiled(TARGET library|light_library|program|cli_program|test|fast_test RPC)
function(litags_precompiled target kind rpc)
  if(rpc)
    set(kind rpc_${kind})
  endif()
  target_precompile_headers(${target} REUSE_FROM litags_${kind}_headers)
endfunction()

# Of files that have no loops to make fast. They compile in two thirds of -O3's time.
set(litags_light_flags $<$<CONFIG:Release>:-O1>)
# Of tests, but those that ask to be FAST. They compile in two thirds of -O1's time.
set(litags_test_flags $<$<CONFIG:Release>:-O0>)

litags_precompile(litags_library_headers HEADERS ${litags_common_headers} FLAGS -fPIC)
litags_precompile(litags_light_library_headers
  HEADERS ${litags_common_headers} FLAGS ${litags_light_flags} -fPIC)
litags_precompile(litags_program_headers
  HEADERS ${litags_common_headers} FLAGS ${litags_light_flags} -fPIE)
# CLI11 makes code in every file that sees it: 4 s of it even in an empty one.
litags_precompile(litags_cli_program_headers
  HEADERS ${litags_common_headers} <CLI/CLI.hpp> FLAGS ${litags_light_flags} -fPIE)
if(BUILD_TESTING)
  set(litags_common_test_headers ${litags_common_headers} <gmock/gmock.h> <gtest/gtest.h>)
  litags_precompile(litags_test_headers
    HEADERS ${litags_common_test_headers} FLAGS ${litags_test_flags} -fPIE DEPS GTest::gmock)
  litags_precompile(litags_fast_test_headers
    HEADERS ${litags_common_test_headers} FLAGS ${litags_light_flags} -fPIE DEPS GTest::gmock)
endif()

# For targets that are added with RPC: most of their files speak gRPC.
if(NOT LITAGS_ENGINE_ONLY)
  set(litags_rpc_headers [["litags/v1/reconstruction_service.grpc.pb.h"]] <grpcpp/grpcpp.h>)
  litags_precompile(litags_rpc_library_headers
    HEADERS ${litags_common_headers} ${litags_rpc_headers} FLAGS ${litags_light_flags} -fPIC
    DEPS litags_proto)
  litags_precompile(litags_rpc_program_headers
    HEADERS ${litags_common_headers} ${litags_rpc_headers} <CLI/CLI.hpp> FLAGS ${litags_light_flags} -fPIE DEPS litags_proto)
  if(BUILD_TESTING)
    litags_precompile(litags_rpc_test_headers
      HEADERS ${litags_common_test_headers} ${litags_rpc_headers}
      FLAGS ${litags_test_flags} -fPIE DEPS litags_proto GTest::gmock)
  endif()
endif()

# What `cmake --install` installs, by component: `programs`, and the libraries `engine` and
# `client`. Of programs and libraries it takes those that were built.
include(CMakePackageConfigHelpers)

# The programs.
set(programs litags litags-server litags-worker litags-train litags-bench litags-sample litags-sheet)
foreach(program ${programs})
  if(TARGET ${program})
    install(TARGETS ${program} RUNTIME COMPONENT programs OPTIONAL)
  endif()
endforeach()

# The systemd unit names the programs by their path, which is known only now: cpack has another
# prefix than this build.
if(TARGET litags-server)
  install(CODE "
    file(READ \"${PROJECT_SOURCE_DIR}/deploy/litags-server.service\" unit)
    string(REPLACE \"/usr/local/bin/\" \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}/\" unit \"\${unit}\")
    file(WRITE \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/lib/systemd/system/litags-server.service\" \"\${unit}\")"
    COMPONENT programs)
endif()

# litags_install_library(COMPONENT targets...): archives, headers and their description, which
# find_package(litags) reads.
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/litags)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/litagsConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
function(litags_install_library component)
  install(TARGETS ${ARGN} EXPORT litags_${component} ARCHIVE COMPONENT ${component} OPTIONAL)
  install(EXPORT litags_${component} NAMESPACE litags:: DESTINATION ${package_dir}
    COMPONENT ${component})
  install(DIRECTORY ${PROJECT_BINARY_DIR}/include/litags_${component}/
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT ${component})
  install(FILES ${PROJECT_SOURCE_DIR}/deploy/cmake/litagsConfig.cmake
    ${PROJECT_BINARY_DIR}/litagsConfigVersion.cmake
    DESTINATION ${package_dir} COMPONENT ${component})
endfunction()
litags_install_library(engine litags_engine)
if(TARGET litags_client)
  litags_install_library(client litags_client litags_proto)
  install(DIRECTORY ${PROJECT_BINARY_DIR}/proto/litags
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client FILES_MATCHING PATTERN "*.pb.h")
endif()

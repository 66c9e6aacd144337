# What `cmake --install` installs, by component: `programs`, and the libraries `engine` and
# `client`. Of programs and libraries it takes those that were built.
include(CMakePackageConfigHelpers)

# The programs, and a man page of each from what it says to --help.
set(programs litags litags-server litags-worker litags-train litags-inspect litags-film litags-bench litags-sample litags-sheet)
foreach(program ${programs})
  if(NOT TARGET ${program})
    continue()
  endif()
  install(TARGETS ${program} RUNTIME COMPONENT programs OPTIONAL)
  if(LITAGS_SANITIZE)
    continue()  # such builds are for tests
  endif()
  set(page ${PROJECT_BINARY_DIR}/man/${program}.1.gz)
  set(asked ${program})
  if(program STREQUAL "litags")
    list(APPEND asked litags-inspect)  # answers litags inspect --help
  endif()
  add_custom_command(OUTPUT ${page}
    COMMAND ${PROJECT_SOURCE_DIR}/deploy/cmake/man_page.sh $<TARGET_FILE:${program}> ${PROJECT_VERSION} ${page}
    DEPENDS ${asked} ${PROJECT_SOURCE_DIR}/deploy/cmake/man_page.sh
    COMMENT "Man page of ${program}")
  list(APPEND pages ${page})
  install(FILES ${page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs OPTIONAL)
endforeach()
add_custom_target(man_pages ALL DEPENDS ${pages})

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
  litags_install_library(client litags_client litags_report litags_proto)
  install(DIRECTORY ${PROJECT_BINARY_DIR}/proto/litags
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT client FILES_MATCHING PATTERN "*.pb.h")
endif()

# The Debian package: the programs, and what only a package has.
if(PROJECT_IS_TOP_LEVEL AND TARGET litags-server)
  set(debian ${PROJECT_SOURCE_DIR}/deploy/debian)
  install(FILES ${debian}/copyright DESTINATION share/doc/litags COMPONENT debian EXCLUDE_FROM_ALL)
  install(FILES ${debian}/server.toml DESTINATION /etc/litags COMPONENT debian EXCLUDE_FROM_ALL)

  set(CPACK_GENERATOR DEB)
  set(CPACK_DEB_COMPONENT_INSTALL ON)
  set(CPACK_COMPONENTS_ALL programs debian)
  set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
  set(CPACK_SET_DESTDIR ON)  # for /etc, and so that the unit sees the real prefix
  set(CPACK_INSTALL_PREFIX /usr)
  set(CPACK_STRIP_FILES ON)
  set(CPACK_PACKAGE_CONTACT "litags maintainers <maintainers@litags.invalid>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "normally lit 3D scenes from badly lit photos")
  set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"Photos taken at night or into glare go in; pictures of the same place, as if
well lit, come out, from any point of view. A gRPC server with its workers, a
client, and programs that work without a server. Everything runs on the CPU.")
  set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
  set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
  # colmap is a child process, which dpkg-shlibdeps cannot see; postinst uses adduser.
  set(CPACK_DEBIAN_PACKAGE_DEPENDS "colmap, adduser")
  set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
    ${debian}/conffiles ${debian}/postinst ${debian}/prerm ${debian}/postrm)
  set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
  include(CPack)
endif()

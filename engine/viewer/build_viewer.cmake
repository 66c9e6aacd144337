# Builds the viewer in the folder WORK from SOURCE with NPM and NODE, and writes it as C++ to OUT. Where
# that cannot be done, it is empty.
include(${CMAKE_CURRENT_LIST_DIR}/../../deploy/cmake/npm.cmake)

file(REMOVE_RECURSE ${WORK}/src)
npm_install(${SOURCE} ${WORK} missing)
set(module ${WORK}/dist/viewer.js)
file(REMOVE ${module})
if(missing)
  message(WARNING "there will be no viewer by WebGL, neither on the page nor for export --format html: ${missing}")
  file(WRITE ${module} "")
else()
  # From here on a failure is a defect of the viewer.
  execute_process(COMMAND ${NODE} node_modules/typescript/bin/tsc WORKING_DIRECTORY ${WORK}
    COMMAND_ERROR_IS_FATAL ANY)
  execute_process(
    COMMAND ${NODE} node_modules/esbuild/bin/esbuild src/viewer.ts --bundle --minify --format=esm
      --legal-comments=none --log-level=error --outfile=${module}
    WORKING_DIRECTORY ${WORK} COMMAND_ERROR_IS_FATAL ANY)
  # PlayCanvas' licence goes where its code goes.
  file(READ ${WORK}/node_modules/playcanvas/LICENSE licence)
  file(READ ${module} code)
  file(WRITE ${module} "/* PlayCanvas:\n${licence}*/\n")
  file(APPEND ${module} "${code}")
  # It is a part of pages, whose script it must not end.
  file(STRINGS ${module} ends REGEX "</[sS][cC][rR][iI][pP][tT]|<!--" LIMIT_COUNT 1)
  if(ends)
    message(FATAL_ERROR "the viewer contains </script or <!--")
  endif()
endif()
file(WRITE ${OUT}.new "#include \"engine/viewer/viewer.h\"\n\nnamespace litags {\nnamespace {\n\n")
embed_bytes(${OUT}.new kModule ${module} digest)
embed_bytes(${OUT}.new kPage ${SOURCE}/standalone.html page_digest)
file(APPEND ${OUT}.new "
}  // namespace

std::string_view ViewerModule() { return {kModule, sizeof(kModule) - 1}; }
std::string_view ViewerDigest() { return \"${digest}\"; }
std::string_view ViewerPage() { return {kPage, sizeof(kPage) - 1}; }

}  // namespace litags
")
publish(${OUT})

# Builds the page in the folder WORK from SOURCE, and from files of VIEWER that the two share, with NPM
# and NODE, and writes it as C++ to OUT. Where that cannot be done, a page that says so takes its place.
include(${CMAKE_CURRENT_LIST_DIR}/../../deploy/cmake/npm.cmake)

# The page in WORK/dist; `why` there is none, or empty.
function(build_page why)
  npm_install(${SOURCE} ${WORK} missing)
  if(missing)
    set(${why} "${missing} when litags-server was built" PARENT_SCOPE)
    return()
  endif()
  # From here on a failure is a defect of the page.
  file(COPY ${VIEWER}/camera.ts ${VIEWER}/contract.ts ${VIEWER}/controls.ts DESTINATION ${WORK}/src)
  file(REMOVE_RECURSE ${WORK}/dist)
  execute_process(COMMAND ${NODE} node_modules/typescript/bin/tsc WORKING_DIRECTORY ${WORK}
    COMMAND_ERROR_IS_FATAL ANY)
  file(COPY ${SOURCE}/app.css ${SOURCE}/icon.svg ${SOURCE}/index.html DESTINATION ${WORK}/dist)
  set(${why} "" PARENT_SCOPE)
endfunction()

set(type_.html "text/html; charset=utf-8")
set(type_.js "text/javascript; charset=utf-8")
set(type_.css "text/css; charset=utf-8")
set(type_.svg "image/svg+xml")

# One file as an array, and its line of the table.
function(embed file)
  cmake_path(GET file FILENAME name)
  cmake_path(GET file EXTENSION LAST_ONLY extension)
  string(MAKE_C_IDENTIFIER "${name}" array)
  set(path "/${name}")
  if(name STREQUAL "index.html")
    set(path "/")
  endif()
  embed_bytes(${OUT}.new k_${array} ${file} etag)
  set(rows "${rows}    {\"${path}\", \"${type_${extension}}\", \"\\\"${etag}\\\"\",
     {k_${array}, sizeof(k_${array}) - 1}},\n" PARENT_SCOPE)
endfunction()

build_page(why)
if(why)
  message(WARNING "litags-server --web will have no page, only the services by HTTP: ${why}")
  file(READ ${SOURCE}/no_page.html page)
  string(REPLACE "@WHY@" "${why}" page "${page}")
  file(REMOVE_RECURSE ${WORK}/dist)
  file(WRITE ${WORK}/dist/index.html "${page}")
endif()
file(WRITE ${OUT}.new "#include \"server/web/assets.h\"\n\nnamespace litags::web {\nnamespace {\n\n")
file(GLOB files ${WORK}/dist/*.*)
foreach(file ${files})
  embed(${file})
endforeach()
file(APPEND ${OUT}.new "\nconstexpr Asset kAssets[] = {\n${rows}};\n\n}  // namespace\n\n"
  "std::span<const Asset> PageAssets() { return kAssets; }\n\n}  // namespace litags::web\n")
publish(${OUT})

# Builds the page in the folder WORK from SOURCE with NPM and NODE, and writes it as C++ to OUT. Where
# that cannot be done, a page that says so takes its place.

# The page in WORK/dist; `why` there is none, or empty.
function(build_page why)
  if(NOT NPM OR NOT NODE)
    set(${why} "node and npm were not installed when litags-server was built" PARENT_SCOPE)
    return()
  endif()
  file(COPY ${SOURCE}/ DESTINATION ${WORK} PATTERN node_modules EXCLUDE)
  file(SHA256 ${SOURCE}/package-lock.json lock)
  if(NOT EXISTS ${WORK}/node_modules/.installed-${lock})
    execute_process(
      COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=0
      WORKING_DIRECTORY ${WORK} RESULT_VARIABLE failed OUTPUT_VARIABLE told ERROR_VARIABLE told
      TIMEOUT 300)
    if(failed)
      message(STATUS "${told}")
      set(${why} "npm could not install TypeScript when litags-server was built" PARENT_SCOPE)
      return()
    endif()
    file(TOUCH ${WORK}/node_modules/.installed-${lock})
  endif()
  # From here on a failure is a defect of the page.
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
  file(READ ${file} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" bytes "${hex}")
  string(SHA256 digest "${hex}")
  string(SUBSTRING ${digest} 0 16 etag)
  set(path "/${name}")
  if(name STREQUAL "index.html")
    set(path "/")
  endif()
  file(APPEND ${OUT}.new "constexpr char k_${array}[] = \"${bytes}\";\n")
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
  "std::span<const Asset> Assets() { return kAssets; }\n\n}  // namespace litags::web\n")
file(RENAME ${OUT}.new ${OUT})

# For scripts of the build that make something with node.

# npm_install(SOURCE WORK WHY): copies the folder SOURCE to WORK and installs what its lock file
# names, by NPM. Sets WHY to why that cannot be done, or to "".
function(npm_install source work why)
  if(NOT NPM OR NOT NODE)
    set(${why} "node and npm were not installed" PARENT_SCOPE)
    return()
  endif()
  file(COPY ${source}/ DESTINATION ${work} PATTERN node_modules EXCLUDE)
  file(SHA256 ${source}/package-lock.json lock)
  if(NOT EXISTS ${work}/node_modules/.installed-${lock})
    execute_process(
      COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline --fetch-retries=0
      WORKING_DIRECTORY ${work} RESULT_VARIABLE failed OUTPUT_VARIABLE told ERROR_VARIABLE told
      TIMEOUT 300)
    if(failed)
      message(STATUS "${told}")
      set_property(GLOBAL PROPERTY npm_failed TRUE)
      set(${why} "npm could not install the packages of ${source}" PARENT_SCOPE)
      return()
    endif()
    file(TOUCH ${work}/node_modules/.installed-${lock})
  endif()
  set(${why} "" PARENT_SCOPE)
endfunction()

# publish(OUT): OUT.new becomes OUT. Where npm failed, the rule's other output OUT.whole is not made, so
# that the next build tries again: the network may be back.
function(publish out)
  file(COPY_FILE ${out}.new ${out} ONLY_IF_DIFFERENT)
  file(REMOVE ${out}.new ${out}.whole)
  get_property(failed GLOBAL PROPERTY npm_failed)
  if(NOT failed)
    file(TOUCH ${out}.whole)
  endif()
endfunction()

# embed_bytes(OUT ARRAY FILE DIGEST): appends the file as an array of C++, and sets DIGEST to the
# start of its SHA-256.
function(embed_bytes out array file digest)
  file(READ ${file} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" bytes "${hex}")
  file(SHA256 ${file} sha256)
  string(SUBSTRING ${sha256} 0 16 start)
  file(APPEND ${out} "constexpr char ${array}[] = \"${bytes}\";\n")
  set(${digest} ${start} PARENT_SCOPE)
endfunction()

# litags_public_headers(TARGET FOLDER headers...)
# Makes the headers that programs outside this project include: each header NAME.h is copied to
# include/litags/FOLDER/NAME.h of the build folder, with its own includes renamed in the same way.
# Headers stay beside their sources, as everywhere in this project, and those outside see one flat
# folder. Stops if a public header includes one that is not public.
function(litags_public_headers target folder)
  set(include_dir ${PROJECT_BINARY_DIR}/include/${target})
  set(names "")
  foreach(header ${ARGN})
    get_filename_component(name ${header} NAME)
    list(APPEND names ${name})
  endforeach()
  # Those of an earlier list.
  file(GLOB made RELATIVE ${include_dir}/${folder} ${include_dir}/${folder}/*.h)
  foreach(name ${made})
    if(NOT name IN_LIST names)
      file(REMOVE ${include_dir}/${folder}/${name})
    endif()
  endforeach()
  foreach(header ${ARGN})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
      ${CMAKE_CURRENT_SOURCE_DIR}/${header})
    file(READ ${header} text)
    string(REGEX MATCHALL "#include \"(engine|client)/[a-z0-9_/]+\\.h\"" includes "${text}")
    foreach(include ${includes})
      string(REGEX REPLACE ".*/([a-z0-9_]+\\.h)\"" "\\1" name ${include})
      if(NOT name IN_LIST names)
        message(FATAL_ERROR "${header} is public and has ${include}, which is not")
      endif()
      string(REPLACE "${include}" "#include \"${folder}/${name}\"" text "${text}")
    endforeach()
    get_filename_component(name ${header} NAME)
    file(CONFIGURE OUTPUT ${include_dir}/${folder}/${name} CONTENT "${text}" @ONLY)
  endforeach()
  target_include_directories(${target} INTERFACE
    $<BUILD_INTERFACE:${include_dir}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
endfunction()

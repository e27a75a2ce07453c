# amrtex_add_encoding(name): the one line that an encoding needs outside its folder. Here it is the folder `name` beside the
# CMakeLists.txt of the line, from which are made
#   - the build side        <name>.cpp, with `std::unique_ptr<Encoding> make_<name>()` declared in <name>.hpp
#   - the CPU build         <name>.glsl compiled as C++ (renderers/cpu/cpu_field.cpp.in)
#   - the registry entry    (structures/common/registry.cpp.in)
#   - the shader library    every .glsl and .h of the folder
#   - the tests             <name>_test.cpp; conformance and differential tests run over the registry
# `amrtex_add_encoding(name TEST)` leaves it out of the program: it stands in the registry of the tests alone.
define_property(GLOBAL PROPERTY AMRTEX_ENCODINGS BRIEF_DOCS "Folders of the program's encodings, in order, from the project's root")
define_property(GLOBAL PROPERTY AMRTEX_TEST_ENCODINGS BRIEF_DOCS "Those that only tests have")

function(amrtex_add_encoding name)
  foreach(part README.md ${name}.hpp ${name}.cpp ${name}.glsl ${name}_layout.h ${name}_test.cpp)
    if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${name}/${part})
      message(FATAL_ERROR "encoding ${name}: ${CMAKE_CURRENT_SOURCE_DIR}/${name}/${part} is missing (CONTRIBUTING.md, \"Add an encoding\")")
    endif()
  endforeach()
  set(property AMRTEX_ENCODINGS)
  if("TEST" IN_LIST ARGN)
    set(property AMRTEX_TEST_ENCODINGS)
  endif()
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR}/${name})
  set_property(GLOBAL APPEND PROPERTY ${property} ${folder})
endfunction()

# A library of the encodings in `folders`: build sides and CPU builds.
function(amrtex_add_encodings_library target folders)
  set(sources "")
  foreach(folder IN LISTS folders)
    get_filename_component(name ${folder} NAME)
    get_filename_component(parent ${folder} DIRECTORY)
    list(APPEND sources ${PROJECT_SOURCE_DIR}/${folder}/${name}.cpp)
    foreach(part IN ITEMS field sampler)
      set(generated ${CMAKE_CURRENT_BINARY_DIR}/${target}/cpu_${part}_${name}.cpp)
      configure_file(${PROJECT_SOURCE_DIR}/renderers/cpu/cpu_${part}.cpp.in ${generated} @ONLY)
      set_source_files_properties(${generated} PROPERTIES
        INCLUDE_DIRECTORIES "${PROJECT_SOURCE_DIR}/${parent};${PROJECT_SOURCE_DIR}/shaders"
        # shader text cannot follow rules that GLSL does not have
        COMPILE_OPTIONS "-Wno-conversion;-Wno-shadow;-Wno-unused-parameter;-Wno-maybe-uninitialized")
      list(APPEND sources ${generated})
    endforeach()
  endforeach()
  add_library(${target} STATIC ${sources})
  target_link_libraries(${target} PUBLIC amrtex_renderers PRIVATE amrtex_headers)
endfunction()

# What a program links to have the encodings in `folders`, which lie in the libraries after them: the list of encodings, the
# list of their CPU builds, and every shader text by its path. Objects, since a library's own code asks for these lists.
function(amrtex_add_registry target folders)
  set(registry_includes "")
  set(registry_factories "")
  set(cpu_declarations "")
  set(cpu_entries "")
  set(sampler_entries "")
  file(GLOB shader_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/shaders/*.glsl ${PROJECT_SOURCE_DIR}/shaders/*.h
       ${PROJECT_SOURCE_DIR}/shaders/*.vert ${PROJECT_SOURCE_DIR}/shaders/*.frag ${PROJECT_SOURCE_DIR}/shaders/*.comp)
  foreach(folder IN LISTS folders)
    get_filename_component(name ${folder} NAME)
    string(APPEND registry_includes "#include \"${folder}/${name}.hpp\"\n")
    string(APPEND registry_factories "      make_${name}(),\n")
    string(APPEND cpu_declarations "std::unique_ptr<CpuField> make_cpu_field_${name}(Precision precision);\n")
    string(APPEND cpu_declarations "std::unique_ptr<CpuField> make_sampler_${name}(const FieldValues& values);\n")
    string(APPEND cpu_entries "  if (encoding == \"${name}\") return make_cpu_field_${name}(precision);\n")
    string(APPEND sampler_entries "  if (encoding == \"${name}\") return make_sampler_${name}(values);\n")
    file(GLOB encoding_files CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${folder}/*.glsl ${PROJECT_SOURCE_DIR}/${folder}/*.h)
    list(APPEND shader_files ${encoding_files})
  endforeach()
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/${target})
  configure_file(${PROJECT_SOURCE_DIR}/structures/common/registry.cpp.in ${generated}/registry.cpp @ONLY)
  configure_file(${PROJECT_SOURCE_DIR}/renderers/cpu/cpu_registry.cpp.in ${generated}/cpu_registry.cpp @ONLY)
  add_custom_command(OUTPUT ${generated}/shader_library.cpp
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${generated}/shader_library.cpp "-DFILES=${shader_files}" -DROOT=${PROJECT_SOURCE_DIR}
            -P ${PROJECT_SOURCE_DIR}/cmake/EmbedShaders.cmake
    DEPENDS ${shader_files} ${PROJECT_SOURCE_DIR}/cmake/EmbedShaders.cmake
    VERBATIM)
  add_library(${target} OBJECT ${generated}/registry.cpp ${generated}/cpu_registry.cpp ${generated}/shader_library.cpp)
  target_link_libraries(${target} PUBLIC ${ARGN})
endfunction()

# amrtex_add_encoding(name): the one line that an encoding needs outside its folder.
# It registers structures/<name>/, from which are made
#   - the build side        <name>.cpp, with `std::unique_ptr<Encoding> make_<name>()` declared in <name>.hpp
#   - the registry entry    (structures/common/registry.cpp.in)
#   - the shader library    every .glsl and .h of the folder
#   - the CPU build         <name>.glsl compiled as C++ (renderers/cpu/cpu_field.cpp.in)
#   - the tests             <name>_test.cpp; conformance and differential tests run over the registry
define_property(GLOBAL PROPERTY AMRTEX_ENCODINGS BRIEF_DOCS "Names of all encodings, in order")

function(amrtex_add_encoding name)
  foreach(part README.md ${name}.hpp ${name}.cpp ${name}.glsl ${name}_layout.h ${name}_test.cpp)
    if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${name}/${part})
      message(FATAL_ERROR "encoding ${name}: structures/${name}/${part} is missing (CONTRIBUTING.md, \"Add an encoding\")")
    endif()
  endforeach()
  set_property(GLOBAL APPEND PROPERTY AMRTEX_ENCODINGS ${name})
  target_sources(amrtex_structures PRIVATE ${name}/${name}.cpp)
endfunction()

# What `cmake --install` puts in place: the program, and beside it what it is tried with and described by. Shaders are
# inside of the program. Documentation and experiments keep their places to one another, so that their links hold.
include(GNUInstallDirs)
set(AMRTEX_SHARE ${CMAKE_INSTALL_DATADIR}/amrtex)

# where a bundle has their libraries (AmrtexBundle.cmake); elsewhere nothing lies there but the module
set_target_properties(amrtex PROPERTIES INSTALL_RPATH "$ORIGIN/../lib/amrtex")
set_target_properties(amrtex_hdf5 PROPERTIES INSTALL_RPATH "$ORIGIN")
target_link_options(amrtex PRIVATE -Wl,--enable-new-dtags)
target_link_options(amrtex_hdf5 PRIVATE -Wl,--enable-new-dtags)
install(TARGETS amrtex RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS amrtex_hdf5 LIBRARY DESTINATION lib/amrtex)
install(PROGRAMS scripts/gpu_check.sh DESTINATION ${AMRTEX_SHARE}/scripts)
install(FILES README.md CONTRIBUTING.md LICENSE CITATION.cff DESTINATION ${AMRTEX_SHARE})
install(DIRECTORY docs data DESTINATION ${AMRTEX_SHARE})
# records are large, and tables hold what people read of them
install(DIRECTORY experiments DESTINATION ${AMRTEX_SHARE}
  PATTERN records EXCLUDE
  PATTERN "*.jsonl.gz" EXCLUDE
  PATTERN "*.npz" EXCLUDE)

file(GLOB_RECURSE readmes RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS
  bench/README.md python/README.md renderers/README.md shaders/README.md structures/README.md tests/README.md)
foreach(readme IN LISTS readmes)
  cmake_path(GET readme PARENT_PATH folder)
  install(FILES ${readme} DESTINATION ${AMRTEX_SHARE}/${folder})
endforeach()

# Run by cpack when the installation lies in its staging folder, once a generator.
file(GLOB_RECURSE programs ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/*bin/amrtex)
if(NOT programs)
  message(FATAL_ERROR "no bin/amrtex below ${CPACK_TEMPORARY_INSTALL_DIRECTORY}")
endif()
list(GET programs 0 program)
cmake_path(GET program PARENT_PATH bin)
cmake_path(GET bin PARENT_PATH prefix)
file(REMOVE_RECURSE ${prefix}/lib/amrtex/python)  # it is for one version of Python
execute_process(COMMAND python3 -B ${CPACK_AMRTEX_SOURCE}/scripts/bundle_libraries.py ${prefix} COMMAND_ERROR_IS_FATAL ANY)
if(CPACK_GENERATOR STREQUAL "TGZ")  # who unpacks it looks there first; a package's folder is /usr
  file(COPY_FILE ${CPACK_AMRTEX_SOURCE}/docs/bundle.md ${prefix}/README.md)
  file(CREATE_LINK share/amrtex/scripts/gpu_check.sh ${prefix}/gpu_check.sh SYMBOLIC)
endif()

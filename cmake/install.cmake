# What is installed: by catkin's rules with ROS, else a plain CMake package. The scripts are not: they set up and
# test a source tree.
#catkin_lint: ignore uninstalled_script
set(core_targets ${PROJECT_NAME})
if(TARGET ${PROJECT_NAME}_io)
  list(APPEND core_targets ${PROJECT_NAME}_io)
endif()
set(program_targets)
foreach(program node arm run bench parity)
  if(TARGET ${PROJECT_NAME}_${program})
    list(APPEND program_targets ${PROJECT_NAME}_${program})
  endif()
endforeach()

if(SPH_MUSCLE_WITH_ROS)
  install(TARGETS ${core_targets}
    ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
    LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
    RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION}
  )
  if(program_targets)
    install(TARGETS ${program_targets} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
  endif()
  install(DIRECTORY include/${PROJECT_NAME}/ DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION}
    FILES_MATCHING PATTERN "*.h" PATTERN "*.inc")
  install(DIRECTORY config launch rviz urdf DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
else()
  #catkin_lint: skip
  include(cmake/install_plain.cmake)
endif()

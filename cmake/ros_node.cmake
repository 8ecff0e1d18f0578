# The ROS node and its tests; included after the core's targets. Nothing happens without ROS.
if(SPH_MUSCLE_WITH_ROS)
  file(GLOB node_sources CONFIGURE_DEPENDS src/node/*.cpp)
  add_executable(${PROJECT_NAME}_node ${node_sources})
  add_dependencies(${PROJECT_NAME}_node ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_include_directories(${PROJECT_NAME}_node SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_link_libraries(${PROJECT_NAME}_node PRIVATE ${PROJECT_NAME}_io ${PROJECT_NAME} ${PROJECT_NAME}_options
                        ${catkin_LIBRARIES})


  if(CATKIN_ENABLE_TESTING)
    find_package(rostest REQUIRED)
    file(GLOB ros_tests CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/*.test)
    foreach(ros_test ${ros_tests})
      add_rostest(${ros_test} DEPENDENCIES ${PROJECT_NAME}_node)
    endforeach()
  endif()
endif()

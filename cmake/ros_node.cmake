# The ROS programs and their tests; included after the core's targets. Nothing happens without ROS.
if(SPH_MUSCLE_WITH_ROS)
  # What the node of one muscle and the arm share
  file(GLOB node_sources CONFIGURE_DEPENDS src/node/*.cpp)
  list(FILTER node_sources EXCLUDE REGEX "main\\.cpp$|/arm\\.cpp$")
  add_library(${PROJECT_NAME}_ros STATIC ${node_sources})
  add_dependencies(${PROJECT_NAME}_ros ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_include_directories(${PROJECT_NAME}_ros SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_link_libraries(${PROJECT_NAME}_ros PUBLIC ${PROJECT_NAME}_io ${PROJECT_NAME} ${PROJECT_NAME}_options
                        ${catkin_LIBRARIES})
  if(OpenMP_CXX_FOUND) # muscles of one node advance side by side; else one after the other
    target_link_libraries(${PROJECT_NAME}_ros PRIVATE OpenMP::OpenMP_CXX)
  endif()

  add_executable(${PROJECT_NAME}_node src/node/main.cpp)
  add_executable(${PROJECT_NAME}_arm src/node/arm_main.cpp src/node/arm.cpp)
  foreach(program node arm)
    add_dependencies(${PROJECT_NAME}_${program} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
    target_include_directories(${PROJECT_NAME}_${program} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
    target_link_libraries(${PROJECT_NAME}_${program} PRIVATE ${PROJECT_NAME}_ros)
  endforeach()

  if(CATKIN_ENABLE_TESTING)
    find_package(rostest REQUIRED)
    file(GLOB ros_tests CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/*.test)
    foreach(ros_test ${ros_tests})
      add_rostest(${ros_test} DEPENDENCIES ${PROJECT_NAME}_node ${PROJECT_NAME}_arm)
    endforeach()
  endif()
endif()

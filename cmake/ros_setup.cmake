# Looks for ROS 1 and makes its messages; included before any target exists, because catkin decides where
# targets are built. cmake/ros_node.cmake is the other half. Sets SPH_MUSCLE_WITH_ROS.

set(SPH_MUSCLE_WITH_ROS FALSE)
if(NOT SPH_MUSCLE_ROS STREQUAL "OFF")
  # A python3 without catkin_pkg (pyenv, conda) in front of the system's would stop find_package(catkin).
  if(NOT PYTHON_EXECUTABLE)
    foreach(python python3 /usr/bin/python3)
      execute_process(COMMAND ${python} -c "import catkin_pkg, em, genmsg" RESULT_VARIABLE python_status
                      OUTPUT_QUIET ERROR_QUIET)
      if(python_status EQUAL 0)
        find_program(python_path ${python})
        set(PYTHON_EXECUTABLE "${python_path}" CACHE FILEPATH "Python with the ROS modules")
        unset(python_path CACHE)
        break()
      endif()
    endforeach()
  endif()
  if(PYTHON_EXECUTABLE AND NOT Python3_EXECUTABLE)
    set(Python3_EXECUTABLE "${PYTHON_EXECUTABLE}" CACHE FILEPATH "The same as PYTHON_EXECUTABLE")
  endif()
  if(PYTHON_EXECUTABLE OR SPH_MUSCLE_ROS STREQUAL "ON")
    # catkin's snapshot of the environment drops folders that do not exist yet; without this one the tests of a
    # fresh build do not find the generated Python messages.
    if(NOT CATKIN_DEVEL_PREFIX)
      set(CATKIN_DEVEL_PREFIX "${CMAKE_BINARY_DIR}/devel")
    endif()
    file(MAKE_DIRECTORY "${CATKIN_DEVEL_PREFIX}/lib/python3/dist-packages")
    if(SPH_MUSCLE_ROS STREQUAL "ON")
      set(catkin_demand REQUIRED)
    else()
      set(catkin_demand QUIET)
    endif()
    #catkin_lint: ignore_once missing_required
    find_package(catkin ${catkin_demand} COMPONENTS
      diagnostic_msgs
      diagnostic_updater
      geometry_msgs
      message_generation
      roscpp
      rosgraph_msgs
      sensor_msgs
      std_msgs
      std_srvs
      tf2
      tf2_ros
      urdf
      visualization_msgs
    )
    set(SPH_MUSCLE_WITH_ROS ${catkin_FOUND})
  endif()
endif()

if(SPH_MUSCLE_WITH_ROS)
  message(STATUS "sph_muscle: with the ROS node")
  add_message_files(FILES EndLoad.msg ExternalForce.msg MuscleState.msg StimulusCommand.msg)
  add_service_files(FILES End.srv Snapshot.srv Step.srv)
  generate_messages(DEPENDENCIES geometry_msgs std_msgs)
  catkin_package(
    INCLUDE_DIRS include
    LIBRARIES ${PROJECT_NAME} ${PROJECT_NAME}_io
    CATKIN_DEPENDS diagnostic_msgs diagnostic_updater geometry_msgs message_runtime roscpp rosgraph_msgs sensor_msgs std_msgs
                   std_srvs tf2 tf2_ros urdf visualization_msgs
  )
else()
  message(STATUS "sph_muscle: without the ROS node (SPH_MUSCLE_ROS=${SPH_MUSCLE_ROS})")
endif()

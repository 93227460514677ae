# Compute kernels: every FOLDER/*.comp is compiled to SPIR-V, validated and embedded in TARGET. The
# generated header HEADER declares one KernelCode per file, namespace NAMESPACE, named as the file:
#
#   weft_embed_kernels(TARGET FOLDER HEADER NAMESPACE)
#
# A new .comp file is found by itself; glslc's dependency files make shared headers trigger rebuilds.
find_program(GLSLC glslc REQUIRED)
find_program(SPIRV_VAL spirv-val REQUIRED)

function(weft_embed_kernels target folder header namespace)
  set(generated ${CMAKE_BINARY_DIR}/generated)
  get_filename_component(out ${generated}/${header} DIRECTORY)
  file(MAKE_DIRECTORY ${out})
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/*.comp)
  set(declarations "")
  set(list "")
  set(embedded "")
  foreach(source ${sources})
    get_filename_component(name ${source} NAME_WE)
    set(spirv ${out}/${name}.spv)
    add_custom_command(
      OUTPUT ${spirv}
      COMMAND ${GLSLC} --target-env=vulkan1.2 -O -Werror -I ${CMAKE_SOURCE_DIR} -MD -MF ${spirv}.d
              -o ${spirv} ${source}
      COMMAND ${SPIRV_VAL} --target-env vulkan1.2 --scalar-block-layout ${spirv}
      DEPENDS ${source}
      DEPFILE ${spirv}.d
      COMMENT "Compiling kernel ${name}"
      VERBATIM)
    add_custom_command(
      OUTPUT ${out}/${name}.cpp
      COMMAND ${CMAKE_COMMAND} -D SPIRV=${spirv} -D NAME=${name} -D NAMESPACE=${namespace}
              -D HEADER=${header} -D OUT=${out}/${name}.cpp
              -P ${CMAKE_SOURCE_DIR}/cmake/embed_spirv.cmake
      DEPENDS ${spirv} ${CMAKE_SOURCE_DIR}/cmake/embed_spirv.cmake
      VERBATIM)
    list(APPEND embedded ${out}/${name}.cpp)
    string(APPEND declarations "extern const KernelCode ${name};\n")
    string(APPEND list "&${name}, ")
  endforeach()
  list(LENGTH sources count)
  file(CONFIGURE OUTPUT ${generated}/${header} @ONLY CONTENT [[
// Generated from the .comp files of one folder: see cmake/embed_kernels.cmake.
#pragma once

#include <array>

#include "render/gpu/kernel_code.h"

namespace @namespace@ {

using weft::render::gpu::KernelCode;

@declarations@
inline constexpr std::array<const KernelCode*, @count@> kAll{@list@};

}  // namespace @namespace@
]])
  target_sources(${target} PRIVATE ${embedded})
  target_include_directories(${target} PUBLIC ${generated})
endfunction()

#pragma once

#include "proto/weft/v1/fabric.pb.h"
#include "shading/fibre_material.h"

namespace weft::coordinator {

// A material of a canonical description, as databases hold it.
[[nodiscard]] shading::FibreMaterial fibre_material(const v1::Material& material);

}  // namespace weft::coordinator

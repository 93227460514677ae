#pragma once

#include "render/image.h"

namespace weft::render {

// Structural similarity (Wang, Bovik, Sheikh and Simoncelli 2004) of two pictures as a screen shows
// them: the luma of tone_mapped() at the exposure that suits the reference, Gaussian window of 11
// pixels and standard deviation 1.5, K1 = 0.01, K2 = 0.03; the mean over the picture, 1 for equal
// pictures. Throws core::Error(kInvalidArgument) when the pictures are not of the same size.
[[nodiscard]] double structural_similarity(const Image& image, const Image& reference);

}  // namespace weft::render

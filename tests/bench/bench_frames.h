// SPDX-License-Identifier: Apache-2.0
// The pictures that the recording benchmark lets cameras deliver, and what they are worth encoded.
#pragma once

#include <vector>

#include "ingest/sources/frame_source.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Sixteen pictures, cut from the middle of the photographs that RAYSTAGE_BENCH_PICTURES (a folder
/// of JPEGs) holds, every `step`-th pixel; painted ones where there are too few.
std::vector<RgbImage> load_bench_images(int width, int height, int step);

/// Full-range 4:2:0 planes. Sizes must be even.
std::vector<SourceFrame> raw_frames(const std::vector<RgbImage>& images);

/// Raw frames as JPEGs of this quality.
std::vector<SourceFrame> jpeg_frames(const std::vector<SourceFrame>& raw, int quality);

/// What JPEGs of that quality show. Quality 100 serves as the planes without loss.
std::vector<RgbImage> decoded(const std::vector<SourceFrame>& raw, int quality);

/// Over all pictures, dB.
double psnr(const std::vector<RgbImage>& a, const std::vector<RgbImage>& b);

}  // namespace raystage

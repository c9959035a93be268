// SPDX-License-Identifier: Apache-2.0
// Pictures that cameras deliver in the recording benchmark, and their quality after encoding.
#pragma once

#include <vector>

#include "ingest/sources/frame_source.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// Returns sixteen pictures: the middle of the photographs in RAYSTAGE_BENCH_PICTURES (a folder of
/// JPEGs), every `step`-th pixel; synthetic ones if there are too few.
std::vector<store::RgbImage> load_bench_images(int width, int height, int step);

/// Returns full-range 4:2:0 planes. Sizes must be even.
std::vector<ingest::SourceFrame> raw_frames(const std::vector<store::RgbImage>& images);

/// Returns raw frames as JPEGs of this quality.
std::vector<ingest::SourceFrame> jpeg_frames(const std::vector<ingest::SourceFrame>& raw,
                                             int quality);

/// Returns the decoded JPEGs of this quality. Quality 100 is used for the planes without loss.
std::vector<store::RgbImage> decoded(const std::vector<ingest::SourceFrame>& raw, int quality);

/// Returns the PSNR over all pictures, dB.
double psnr(const std::vector<store::RgbImage>& a, const std::vector<store::RgbImage>& b);

}  // namespace raystage

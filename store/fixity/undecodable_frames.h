// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <stop_token>
#include <vector>

#include "store/fixity/verify_archive.h"
#include "store/take.h"

namespace raystage::store {

/// Times of frames, by camera of a take.
using FrameTimes = std::vector<std::set<Nanoseconds>>;

/// Returns, by camera, the stored frames of video that cannot be decoded although their own bytes
/// are whole: a frame to which they refer, directly or through others, is lost or in `damaged`.
/// Decodes nothing; reads the beginning of each frame, and frames whose hash no record states.
/// Frames of missing archives are lost. Ends early at a stop. Throws Error if an archive cannot be
/// read.
std::vector<std::vector<AffectedFrame>> find_undecodable_frames(const Take& take,
                                                                const FrameTimes& damaged,
                                                                const std::stop_token& stop = {});

}  // namespace raystage::store

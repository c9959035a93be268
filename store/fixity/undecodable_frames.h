// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>
#include <vector>

#include "store/fixity/verify_archive.h"
#include "store/take.h"

namespace raystage::store {

/// Times of frames, by camera of a take.
using FrameTimes = std::vector<std::set<Nanoseconds>>;

/// Returns, by camera, the stored frames of video that cannot be decoded although their own bytes
/// are whole: a frame to which they refer, directly or through others, is lost or in `damaged`
/// (empty: none is damaged). Decodes nothing; reads the beginning of each frame of video.
std::vector<std::vector<AffectedFrame>> find_undecodable_frames(const Take& take,
                                                                const FrameTimes& damaged);

/// Returns whether records of an archive state frames that it lacks, as after a repair: only then,
/// or if frames are damaged, others can be undecodable.
bool has_torn_records(const Take& take);

}  // namespace raystage::store

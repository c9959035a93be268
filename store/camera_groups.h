// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "store/archive.h"

namespace raystage::store {

/// A frame of a group across cameras.
struct GroupMember {
  int camera = 0, frame = 0;  ///< in the take, and in the camera's archive
  FrameBytes bytes;           ///< as stored
};

/// Returns an archive; null if it cannot be read: its frames are lost. Throws Error (failed) if it
/// is on another host.
const ArchiveReader* readable_archive(const TakeArchives& take, int camera);

/// Returns the frames of a group from its first to frame `frame` of `camera`; none if one of them
/// is lost or its bytes are not the recorded ones, also if its archive cannot be read. Throws Error
/// (failed) if an archive is on another host.
std::vector<GroupMember> group_up_to(const TakeArchives& take, int camera, int frame);

/// Appends the frames that follow in the group, as far as they are intact and the nearest of their
/// cameras to the first: a reader decodes them together. Others cost another decoding only.
void extend_group(const TakeArchives& take, std::vector<GroupMember>& group);

}  // namespace raystage::store

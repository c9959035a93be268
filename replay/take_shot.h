// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "replay/shot_files.h"
#include "schemas/shot_document.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::replay {

/// A shot as text, with the file that it is or would be in, relative to the viewer's folder.
struct ShotText {
  std::string file, text;
};

/// Returns a shot that shows a whole take, for a viewer: one light field layer, a camera at the
/// centre of the array with the lens of its cameras, focused at the optimal focal depth (thesis
/// eq. 2.2; 5 m if the take has no depth range), one frame per tick. The rate is that of the
/// timeline as shots write it: rates of film, six decimals, or 24 for more than 1000 ticks per
/// second; the layer's speed makes up for the difference. `path`: of the take, relative to the
/// folder of the shot.
schemas::ShotDocument make_take_shot(const store::Take& take, const store::Timeline& timeline,
                                     const std::string& path);

/// Returns the shot of the take in a folder. `shot_folder`: the viewer's; the shot would be beside
/// the take there. Throws Error (bad input) if the take or its timeline cannot be read.
ShotText open_take_shot(const std::filesystem::path& take_folder,
                        const std::filesystem::path& shot_folder);

/// Returns the shot as its file has it now, if there is one; else `shot` itself, also where the
/// file is no valid shot or shows other takes only.
ShotText saved_shot(const ShotFiles& files, const ShotText& shot);

/// Returns the camera whose centre is nearest to the array's.
int central_camera(const rig::Rig& rig);

}  // namespace raystage::replay

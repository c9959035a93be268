// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

/// Returns the picture that a model names, with or without its extension, in the first of `folders`
/// that contains it. It is a regular file below the folder and not behind links, unless the user
/// permits these (contained_path.h). `place`: of the name. Throws Error (bad input) if none
/// contains it, and for names that leave the folder.
std::filesystem::path find_named_picture(std::span<const std::filesystem::path> folders,
                                         const std::string& image, const std::string& place);

/// The pictures of a camera: either a movie, or files by increasing number.
struct CameraPictures {
  struct Picture {
    std::filesystem::path file;
    std::int64_t number = 0;  ///< in its name, or else its position in the order of the names
  };
  std::filesystem::path movie;  ///< empty: pictures
  std::vector<Picture> pictures;
};

/// Returns the pictures of each camera: in a folder, the files of a folder with the camera's id
/// (cam0/000000.png), a movie (cam0.mp4) or a still (cam0.jpg). All cameras are in the first of
/// `folders` that has some of the first camera. Files are not read through links in these folders,
/// unless the user permits it (contained_path.h). Throws Error (bad input) at the camera's place if
/// there are none, for more than a million pictures, and for two pictures of one number.
std::vector<CameraPictures> find_pictures_by_id(std::span<const std::filesystem::path> folders,
                                                std::span<const ForeignRig::Camera> cameras);

}  // namespace raystage::ingest

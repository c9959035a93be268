// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "schemas/rig_document.h"

namespace raystage::ingest {

/// A text file in memory; errors use `name` as the file name.
struct NamedText {
  std::string name, text;
};

/// What a file of another program states about an array.
struct ForeignRig {
  struct Camera {
    schemas::CameraGeometry geometry;
    std::string image = {};  ///< the picture that the file names; empty: found by the camera's id
    std::string place = {};  ///< where in the file, for errors: "NAME#/json/pointer" or "NAME:line"
  };
  std::vector<Camera> cameras;
  bool arbitrary_scale = false;    ///< the unit of length is unknown
  std::vector<std::string> notes;  ///< approximations and what was ignored, as sentences
};

/// The files that describe an array for another program.
struct ExportedRig {
  std::vector<NamedText> files;    ///< named as RigFormat::files()
  std::vector<std::string> notes;  ///< what the files do not hold, as sentences
};

struct PictureSize {
  int width = 0, height = 0;  ///< pixels
};
/// Returns the size of a picture that a camera's entry names. `place`: of that entry. Throws Error
/// (bad input) if there is no such picture.
using PictureSizeReader =
    std::function<PictureSize(const std::string& image, const std::string& place)>;

/// The top level of a JSON document: the keys of the object, or of the first item of a list.
struct JsonOutline {
  bool is_list = false;
  std::vector<std::string> keys;
  bool has(std::string_view key) const;
};

/// A format in which other programs describe arrays of cameras. To add one: a file that implements
/// this, and a line in rig_formats.cpp.
class RigFormat {
 public:
  virtual ~RigFormat() = default;
  /// Returns the name by which users choose the format.
  virtual std::string_view name() const = 0;
  /// Returns what its files are, for texts: "rig.json of facebook360_dep and Surround360".
  virtual std::string_view description() const = 0;
  /// Returns the names of its files in a folder; parse() needs all that are not optional.
  virtual std::vector<std::string> files() const = 0;
  /// Returns how many of files(), from the first on, parse() needs.
  virtual std::size_t needed_files() const { return 1; }
  /// Returns the folders in which files() are searched, relative to a folder that a user names.
  virtual std::vector<std::string> model_folders() const { return {""}; }
  /// Returns the folders in which pictures are searched, relative to that of the files.
  virtual std::vector<std::string> picture_folders() const = 0;
  /// Returns the largest file that parse() takes, bytes.
  virtual std::uint64_t max_bytes() const { return kMaxFileBytes; }
  /// Returns whether a JSON file of any name has this format.
  virtual bool matches(const JsonOutline& outline) const = 0;
  /// Throws Error (bad input) with advice if a path, or a folder of model_folders() below it, is of
  /// a variant of the format that is not supported.
  virtual void check_variant(const std::filesystem::path& /*path*/) const {}

  /// Returns the cameras of the first needed_files() of files(). `size_of_picture` is called for
  /// cameras without a size; null: there are no pictures. Throws Error (bad input) with the place.
  virtual ForeignRig parse(std::span<const NamedText> files,
                           const PictureSizeReader& size_of_picture) const = 0;
  /// Returns the files of a rig. Throws Error (bad input) with camera and lens if the format cannot
  /// hold a lens.
  virtual ExportedRig format(const schemas::RigDocument& rig) const = 0;
};

/// Returns all formats, in the order in which folders are searched; they live until the program
/// ends.
std::span<const RigFormat* const> rig_formats();
/// Returns the format of this name. Throws std::logic_error if there is none.
const RigFormat& rig_format(std::string_view name);

/// Returns the format of a JSON text, or null. Throws Error (bad input) if it is not JSON.
const RigFormat* detect_rig_format(const JsonOutline& outline);

}  // namespace raystage::ingest

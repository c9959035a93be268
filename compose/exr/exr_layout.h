// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

/// How views and layers are spread over parts and channel names.
enum class ExrLayout {
  kStandard,  ///< OpenEXR's own recommendation: a part for each layer of each view
  kSingle,    ///< one part, as readers before OpenEXR 2 know it
  kNuke       ///< the same with depth as `depth.Z`, as Nuke shows it
};

/// Throws Error (bad input) naming the layouts there are.
ExrLayout parse_exr_layout(std::string_view name);

/// Values of one layer of a view, interleaved pixel by pixel from the top left. Several of one name
/// belong together.
struct ExrLayer {
  std::string name;                   ///< "" for the picture itself, "depth", "lf" ...
  std::vector<std::string> channels;  ///< "R", "G", "B", "A"; "Z"; ...
  bool is_colour = false;             ///< half, in the file's space; else data
  std::span<const float> values;
  float nan_replacement = 0;  ///< what stands where a value is no number
  bool is_half_data = false;  ///< data for which half will do; other data is float

  bool is_half() const { return is_colour || is_half_data; }
};

/// A view of a frame.
struct ExrView {
  std::string name;  ///< "left", "right"; "" where there is just one
  std::vector<ExrLayer> layers;
};

struct ExrPartChannel {
  std::string name;  ///< in the file
  std::size_t view = 0, layer = 0, channel = 0;
};

/// A part to be written.
struct ExrPart {
  std::string name;                   ///< "" in a file of one part
  std::string view;                   ///< "" where it has none
  std::size_t camera_view_index = 0;  ///< index of the view whose camera its header tells
  bool is_colour = true;
  std::vector<ExrPartChannel> channels;
};

/// Parts of a file of these views, which have the same layers. The first part holds the picture of
/// the first view, which is the default one. "Storing multi-view images in OpenEXR files"
/// (openexr.com): parts have unique names and, where there are several views, the attribute `view`;
/// in a single part channels of other views than the default are called layer.view.channel.
std::vector<ExrPart> make_exr_parts(std::span<const ExrView> views, ExrLayout layout);

}  // namespace raystage

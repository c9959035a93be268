// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::compose {

/// How views and layers are assigned to parts and channel names.
enum class ExrLayout {
  kStandard,  ///< OpenEXR's recommendation: one part for each layer of each view
  kSingle,    ///< one part, for readers older than OpenEXR 2
  kNuke       ///< one part with depth as `depth.Z`, as Nuke expects it
};

/// Version of the channel names, which files of one sequence share. 2: `coverage.V`, before
/// `lf.coverage`; 3: `coverage.left.V` of the left view in files of one part.
inline constexpr int kExrChannelNames = 3;

/// Returns the layout with this name. Throws Error (bad input), which lists the layouts, otherwise.
ExrLayout parse_exr_layout(std::string_view name);

/// Values of one layer of a view, interleaved by pixel from the top left. Those with the same name
/// form one layer of the file.
struct ExrLayer {
  std::string name;                   ///< "" for the colours, "depth", "lf" ...
  std::vector<std::string> channels;  ///< "R", "G", "B", "A"; "Z"; ...
  bool is_colour = false;             ///< half, in the file's space; else data
  std::span<const float> values;
  float nan_replacement = 0;  ///< replaces NaN
  bool is_half_data = false;  ///< stores data as half instead of float

  bool is_half() const { return is_colour || is_half_data; }
};

/// A view of a frame.
struct ExrView {
  std::string name;  ///< "left", "right"; "" if there is only one
  std::vector<ExrLayer> layers;
};

struct ExrPartChannel {
  std::string name;  ///< in the file
  std::size_t view = 0, layer = 0, channel = 0;
};

/// A part to be written.
struct ExrPart {
  std::string name;                   ///< "" in a file of one part
  std::string view;                   ///< "" for none
  std::size_t camera_view_index = 0;  ///< index of the view whose camera the header describes
  bool is_colour = true;
  std::vector<ExrPartChannel> channels;
};

/// Returns the parts of a file of these views, which have the same layers. The first part has the
/// colours of the first view, the default view. As in "Storing multi-view images in OpenEXR files"
/// (openexr.com), parts have unique names and, if there are several views, the attribute `view`. In
/// a single part, channels of other views are called layer.view.channel.
std::vector<ExrPart> make_exr_parts(std::span<const ExrView> views, ExrLayout layout);

}  // namespace raystage::compose

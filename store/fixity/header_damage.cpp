// SPDX-License-Identifier: Apache-2.0
#include "store/fixity/header_damage.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace raystage::store {

using Bytes = std::span<const std::byte>;

std::size_t first_difference(Bytes a, Bytes b) {
  return static_cast<std::size_t>(std::ranges::mismatch(a, b).in1 - a.begin());
}

std::vector<Damage> find_header_damage(Bytes archive, const matroska::Header& header,
                                       const matroska::Trailer& closing, bool is_marked_closed) {
  std::vector<Damage> damages;
  if (archive.size() < header.bytes.size()) {
    if (!matroska::begins_with(archive, header) || is_marked_closed) {
      damages.push_back({0, "the archive's header is damaged and truncated"});
    }
    return damages;
  }
  const auto compare = [&](std::size_t begin, std::size_t end, Bytes closed_form,
                           std::string_view part) {
    const Bytes found = archive.subspan(begin, end - begin);
    const Bytes open_form = Bytes(header.bytes).subspan(begin, end - begin);
    const bool filled_in = !closed_form.empty();
    // close() fills in the parts one after another; until then a part is as in recording.
    if (filled_in && std::ranges::equal(found, closed_form)) return;
    if (!(filled_in && is_marked_closed) && std::ranges::equal(found, open_form)) return;
    const Bytes wanted = filled_in && is_marked_closed ? closed_form : open_form;
    damages.push_back(
        {begin + first_difference(found, wanted),
         fmt::format("the header's {} does not match the journal, take.json and rig.json", part)});
  };
  compare(0, header.segment_size_offset, {}, "beginning");
  if (is_marked_closed) {
    compare(header.segment_size_offset, header.segment_data_offset, closing.segment_size,
            "segment size");
  }
  compare(header.seek_head_offset, header.info_offset, closing.seek_head, "SeekHead");
  compare(header.info_offset, header.duration_offset, {}, "Info");
  compare(header.duration_offset, header.duration_offset + matroska::kDurationBytes,
          closing.duration, "Duration");
  std::size_t rest = header.duration_offset + matroska::kDurationBytes;
  if (header.rate_offset > 0) {
    compare(rest, header.rate_offset, {}, "Tracks");
    rest = header.rate_offset + matroska::kRateBytes;
    compare(header.rate_offset, rest, closing.rate, "DefaultDuration");
  }
  compare(rest, header.bytes.size(), {}, "Tracks");
  return damages;
}

}  // namespace raystage::store

// SPDX-License-Identifier: Apache-2.0
#include "schemas/views_document.h"

#include "schemas/fields.h"

namespace raystage::schemas {
namespace {

using View = ViewsDocument::View;

/// A view has no position in the grid.
constexpr auto kRemoveGridPosition = custom([](const JsonNode&, const View&) {},
                                            [](const View&, nlohmann::ordered_json& object) {
                                              object.erase("row");
                                              object.erase("col");
                                            });

constexpr Fields kViews(required("color_space", &ViewsDocument::color_space),
                        required("views", &ViewsDocument::views,
                                 list_with_ids(Fields(kGeometryFields, kRemoveGridPosition,
                                                      optional("file", &View::file, kPath),
                                                      optional("depth", &View::depth_file, kPath),
                                                      optional("light", &View::light_file, kPath),
                                                      defaulted("time_ns", &View::time_ns)))));

}  // namespace

ViewsDocument parse_views(std::string_view text, std::string_view name) {
  return parse_document_as<ViewsDocument>("views", kViews, text, name);
}

std::string format_views(const ViewsDocument& views) {
  return format_document("views", kViews, views);
}

ViewsDocument read_views(const std::filesystem::path& file) {
  return parse_views(read_file(file), file.string());
}

void write_views(const ViewsDocument& views, const std::filesystem::path& file) {
  write_document(format_views(views), parse_views, file);
}

}  // namespace raystage::schemas

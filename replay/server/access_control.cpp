// SPDX-License-Identifier: Apache-2.0
#include "replay/server/access_control.h"

#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "base/error.h"

namespace raystage::replay {
namespace {

bool is_host_known(const AccessRules& rules, std::string_view host) {
  return std::ranges::find(rules.hosts, lower_case(host)) != rules.hosts.end();
}

/// Compares in a time that does not depend on where the texts differ.
bool is_equal_in_constant_time(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  }
  return difference == 0;
}

std::string_view first_segment(std::string_view target) {
  if (!target.starts_with('/')) return {};
  target.remove_prefix(1);
  return target.substr(0, target.find('/'));
}

}  // namespace

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower;
}

AccessDecision check_access(const AccessRules& rules, const AccessRequest& request) {
  if (!request.host || !is_host_known(rules, *request.host)) return AccessDecision::kWrongHost;
  if (request.is_web_socket && !request.origin) return AccessDecision::kWrongOrigin;
  constexpr std::string_view kScheme = "http://";
  if (request.origin && (!request.origin->starts_with(kScheme) ||
                         !is_host_known(rules, request.origin->substr(kScheme.size())))) {
    return AccessDecision::kWrongOrigin;
  }
  const std::string_view token = first_segment(request.target);
  const bool has_token = !rules.token.empty() && is_equal_in_constant_time(token, rules.token) &&
                         request.target.size() > token.size() + 1;
  return has_token ? AccessDecision::kGranted : AccessDecision::kWrongToken;
}

std::string_view path_in_target(const AccessRules& rules, std::string_view target) {
  target.remove_prefix(std::min(target.size(), rules.token.size() + 2));
  return target.substr(0, target.find('?'));
}

std::string make_random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw Error::from_errno("no random numbers", "getrandom", "Check the operating system");
  }
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

}  // namespace raystage::replay

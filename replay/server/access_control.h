// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::replay {

/// Which requests a server answers.
struct AccessRules {
  std::string token;  ///< first segment of every path: http://HOST/TOKEN/...
  /// Values of the header `Host` that name this server, in lower case, such as "127.0.0.1:8080". A
  /// page of another site whose name was rebound to this address sends its own name.
  std::vector<std::string> hosts;
};

enum class AccessDecision {
  kGranted,
  kWrongHost,    ///< `Host` is missing or not one of the rules
  kWrongOrigin,  ///< a page of another site sent the request
  kWrongToken
};

/// A request as far as access depends on it.
struct AccessRequest {
  std::string_view target;  ///< "/TOKEN/..."
  std::optional<std::string_view> host, origin;
  bool is_web_socket = false;  ///< these must state their origin
};

/// Returns whether a request is answered. Tokens are compared in constant time.
AccessDecision check_access(const AccessRules& rules, const AccessRequest& request);

/// Returns the part of a granted request's target behind "/TOKEN/", without a query.
std::string_view path_in_target(const AccessRules& rules, std::string_view target);

/// Returns a text in ASCII lower case, as the hosts of the rules are.
std::string lower_case(std::string_view text);

/// Returns 128 random bits of the operating system in hexadecimal. Throws Error (failed).
std::string make_random_token();

}  // namespace raystage::replay

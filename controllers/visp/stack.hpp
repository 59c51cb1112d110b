// The messages of docs/stacks.md in C++, with the standard library alone.

#pragma once

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

namespace stack {

// The place behind `"key":` in a JSON text, from a place on; npos if the key does not occur.
inline std::size_t place(const std::string& json, const std::string& key, std::size_t from = 0) {
  const std::size_t at = json.find("\"" + key + "\":", from);
  return at == std::string::npos ? at : at + key.size() + 3;
}

// All numbers of the value of a key, in the order of the text, through nested lists.
// Limits that do not exist, null, become `none`.
inline std::vector<double> numbers(const std::string& json, const std::string& key,
                                   std::size_t from = 0, double none = 1e6) {
  std::size_t at = place(json, key, from);
  if (at == std::string::npos) throw std::runtime_error("no key " + key);
  std::vector<double> found;
  int depth = 0;
  do {
    const char c = json[at];
    if (c == '[') ++depth;
    if (c == ']') --depth;
    if (c == '-' || (c >= '0' && c <= '9')) {
      char* end = nullptr;
      found.push_back(std::strtod(&json[at], &end));
      at = end - json.data();
    } else if (c == 'n') {
      found.push_back(none);
      at += 4;
    } else {
      ++at;
    }
  } while (depth > 0 && at < json.size());
  return found;
}

// The place behind the closing quote of a text that begins at a place.
inline std::size_t behind_text(const std::string& json, std::size_t at) {
  for (++at; at < json.size() && json[at] != '"'; ++at)
    if (json[at] == '\\') ++at;
  return at + 1;
}

// The text that is the value of a key.
inline std::string text(const std::string& json, const std::string& key, std::size_t from = 0) {
  const std::size_t value = place(json, key, from);
  if (value == std::string::npos) throw std::runtime_error("no key " + key);
  const std::size_t at = json.find('"', value);
  return json.substr(at + 1, behind_text(json, at) - at - 2);
}

// Raise an error for a setting that is none of the known names, or that is no number.
inline void check_settings(const std::string& setup, const std::vector<std::string>& known) {
  std::size_t at = setup.find_first_of("\"}", place(setup, "settings"));
  while (at < setup.size() && setup[at] == '"') {
    const std::size_t end = behind_text(setup, at);
    const std::string name = setup.substr(at + 1, end - at - 2);
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      std::string all;
      for (const std::string& each : known) all += (all.empty() ? "" : ", ") + each;
      throw std::runtime_error("unknown setting '" + name + "': there are " + all);
    }
    char* behind = nullptr;
    std::strtod(&setup[end + 1], &behind);
    if (behind == &setup[end + 1])
      throw std::runtime_error("the setting " + name + " must be a number");
    at = setup.find_first_of("\"}", behind - setup.data());
  }
}

// A number of the settings, or its default.
inline double setting(const std::string& setup, const std::string& key, double normally) {
  const std::size_t settings = place(setup, "settings");
  const std::size_t end = setup.find('}', settings);
  const std::size_t at = place(setup, key, settings);
  return at == std::string::npos || at > end ? normally : std::strtod(&setup[at], nullptr);
}

// Write the answer of a period: joint velocities, and the time that computing them took [s].
inline void answer(const std::vector<double>& velocity, double seconds) {
  std::cout << "{\"velocity\":[";
  for (std::size_t j = 0; j < velocity.size(); ++j) std::cout << (j ? "," : "") << velocity[j];
  std::cout << "],\"compute_s\":" << seconds << "}" << std::endl;
}

}  // namespace stack

// Image-based visual servoing in C++ with the standard library alone, as a stack for comparisons.
//
//   c++ -O2 -std=c++17 image_based.cpp -o image_based
//   vsconstraints compare --scenario ur5-fov --stack ./image_based
//
// The joint velocities solve (JᵀJ + μI) q̇ = −λ Jᵀ e, with e = x − x* and J = L(x, Z) J_camera.

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

using Numbers = std::vector<double>;

// All numbers of the value of a key, in the order of the text, through nested lists.
Numbers numbers(const std::string& json, const std::string& key, std::size_t from = 0) {
  std::size_t at = json.find("\"" + key + "\":", from);
  if (at == std::string::npos) {
    std::cerr << "no key " << key << std::endl;
    std::exit(1);
  }
  at += key.size() + 3;
  Numbers found;
  int depth = 0;
  do {
    const char c = json[at];
    if (c == '[') ++depth;
    if (c == ']') --depth;
    if (c == '-' || (c >= '0' && c <= '9')) {
      char* end = nullptr;
      found.push_back(std::strtod(&json[at], &end));
      at = end - json.data();
    } else {
      ++at;
    }
  } while (depth > 0);
  return found;
}

// The solution of A x = b by Gaussian elimination; A is symmetric and positive definite.
Numbers solve(std::vector<Numbers> A, Numbers b) {
  const std::size_t n = b.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = i + 1; k < n; ++k) {
      const double factor = A[k][i] / A[i][i];
      for (std::size_t j = i; j < n; ++j) A[k][j] -= factor * A[i][j];
      b[k] -= factor * b[i];
    }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t j = i + 1; j < n; ++j) b[i] -= A[i][j] * b[j];
    b[i] /= A[i][i];
  }
  return b;
}

int main() {
  const double gain = 1.0, damping = 1e-8;
  std::cout << R"({"protocol": 1, "name": "image-based C++", "output": "velocity", )"
            << R"("uses": ["camera", "goals", "target", "pixels", "pose", "jacobian"]})"
            << std::endl;
  std::string setup, line;
  std::getline(std::cin, setup);
  if (setup.find("\"model\":\"none\"", setup.find("\"distortion\":")) == std::string::npos) {
    std::cerr << "this stack is for cameras without distortion" << std::endl;
    return 1;
  }
  const Numbers camera = numbers(setup, "intrinsics");
  const Numbers markers = numbers(setup, "markers");
  const Numbers goal = numbers(setup, "pixels", setup.find("\"goals\":"));
  const std::size_t m = markers.size() / 3;
  std::cout.precision(17);
  while (std::getline(std::cin, line)) {
    const Numbers pixels = numbers(line, "pixels");
    const Numbers pose = numbers(line, "camera_in_target");  // 4 × 4, row by row
    const Numbers jacobian = numbers(line, "jacobian");      // 6 × n, row by row
    const std::size_t n = jacobian.size() / 6;
    std::vector<Numbers> H(n, Numbers(n, 0.0));
    Numbers g(n, 0.0);
    for (std::size_t i = 0; i < m; ++i) {
      double Z = 0.0;
      for (int k = 0; k < 3; ++k) Z += (markers[3 * i + k] - pose[4 * k + 3]) * pose[4 * k + 2];
      const double x = (pixels[2 * i] - camera[2]) / camera[0];
      const double y = (pixels[2 * i + 1] - camera[3]) / camera[1];
      const double L[2][6] = {{-1 / Z, 0, x / Z, x * y, -1 - x * x, y},
                              {0, -1 / Z, y / Z, 1 + y * y, -x * y, -x}};
      for (int c = 0; c < 2; ++c) {
        const double error = (pixels[2 * i + c] - goal[2 * i + c]) / camera[c];
        Numbers row(n, 0.0);
        for (std::size_t j = 0; j < n; ++j)
          for (int k = 0; k < 6; ++k) row[j] += L[c][k] * jacobian[k * n + j];
        for (std::size_t j = 0; j < n; ++j) {
          g[j] -= gain * row[j] * error;
          for (std::size_t k = 0; k < n; ++k) H[j][k] += row[j] * row[k];
        }
      }
    }
    for (std::size_t j = 0; j < n; ++j) H[j][j] += damping;
    const Numbers qd = solve(H, g);
    std::cout << "{\"velocity\": [";
    for (std::size_t j = 0; j < n; ++j) std::cout << (j ? ", " : "") << qd[j];
    std::cout << "]}" << std::endl;
  }
}

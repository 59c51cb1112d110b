// ViSP's vpServo as a stack: image points or the camera's pose, and avoidance of joint limits.
//
//   c++ -O2 -std=c++17 visp_stack.cpp -o visp_stack -lvisp_core -lvisp_visual_features -lvisp_vs
//
// The feature is that of the scenario. Settings:
//   gain          λ [1/s]; with gain_at_zero, the gain far from the goal
//   gain_at_zero  adaptive gain at zero error [1/s]; 0 for a constant gain
//   slope         slope of the adaptive gain at zero error
//   avoidance     1 adds secondaryTaskJointLimitAvoidance with rho, rho1 and lambda_tune
//   saturation    1 scales the joint velocities to the speed limits, as vpRobot does
//   desired       1 takes the interaction matrix at the goal, 0 the current one
//
// It ends, with the reason, for another feature or setting, a camera with distortion, and a goal
// without a pose of the camera.

#include <visp3/core/vpColVector.h>
#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpMatrix.h>
#include <visp3/visual_features/vpFeaturePoint.h>
#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/visual_features/vpFeatureTranslation.h>
#include <visp3/vs/vpServo.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>

#include "stack.hpp"

namespace {

const std::vector<std::string> SETTINGS = {"gain",       "gain_at_zero", "slope",
                                           "avoidance",  "rho",          "rho1",
                                           "lambda_tune", "saturation",  "desired"};

// Raise an error for a setup that this program would not servo as it says.
void check(const std::string& setup) {
  stack::check_settings(setup, SETTINGS);
  const std::string feature = stack::text(setup, "feature");
  if (feature != "camera-pose" && feature != "image-points")
    throw std::runtime_error("this program does not servo by the feature " + feature +
                             ", only by camera-pose or image-points");
  const std::string lens = stack::text(setup, "model", stack::place(setup, "distortion"));
  if (lens != "none")
    throw std::runtime_error("this program is for cameras without distortion, not " + lens);
}

vpHomogeneousMatrix pose(const std::vector<double>& rows) {
  if (rows.size() != 16)
    throw std::runtime_error("this program needs goals with a pose of the camera");
  vpHomogeneousMatrix M;
  for (unsigned i = 0; i < 3; ++i)
    for (unsigned j = 0; j < 4; ++j) M[i][j] = rows[4 * i + j];
  return M;
}

vpColVector column(const std::vector<double>& values) {
  vpColVector v(static_cast<unsigned>(values.size()));
  for (unsigned i = 0; i < v.getRows(); ++i) v[i] = values[i];
  return v;
}

class Servo {
 public:
  explicit Servo(const std::string& setup)
      : camera_(stack::numbers(setup, "intrinsics")),
        markers_(stack::numbers(setup, "markers")),
        goals_(stack::place(setup, "goals")),
        setup_(setup),
        by_pose_(stack::text(setup, "feature") == "camera-pose") {
    const double gain = stack::setting(setup, "gain", 1.0);
    const double at_zero = stack::setting(setup, "gain_at_zero", 0.0);
    avoids_ = stack::setting(setup, "avoidance", 0.0) != 0.0;
    saturates_ = stack::setting(setup, "saturation", 1.0) != 0.0;
    rho_ = stack::setting(setup, "rho", 0.1);
    rho1_ = stack::setting(setup, "rho1", 0.3);
    tune_ = stack::setting(setup, "lambda_tune", 0.7);
    const std::size_t limits = stack::place(setup, "limits");
    lower_ = column(stack::numbers(setup, "lower", limits, -1e6));
    upper_ = column(stack::numbers(setup, "upper", limits, 1e6));
    fastest_ = column(stack::numbers(setup, "velocity", limits, 1e6));
    task_.setServo(vpServo::EYEINHAND_L_cVe_eJe);
    const bool desired = stack::setting(setup, "desired", 0.0) != 0.0;
    task_.setInteractionMatrixType(desired ? vpServo::DESIRED : vpServo::CURRENT,
                                   vpServo::PSEUDO_INVERSE);
    if (at_zero > 0.0)
      task_.setLambda(at_zero, gain, stack::setting(setup, "slope", 30.0));
    else
      task_.setLambda(gain);
    // the Jacobian is that of the camera, in the camera's frame
    task_.set_cVe(vpVelocityTwistMatrix());
    if (by_pose_) {
      task_.addFeature(translation_, translation_at_goal_);
      task_.addFeature(rotation_, rotation_at_goal_);
    } else {
      const std::size_t m = markers_.size() / 3;
      points_.resize(m);
      points_at_goal_.resize(m);
      for (std::size_t i = 0; i < m; ++i) task_.addFeature(points_[i], points_at_goal_[i]);
    }
  }

  std::vector<double> step(const std::string& now) {
    set_goal(static_cast<std::size_t>(stack::numbers(now, "goal")[0]));
    const vpHomogeneousMatrix oMc = pose(stack::numbers(now, "camera_in_target"));
    if (by_pose_) {
      const vpHomogeneousMatrix cdMc = cdMo_ * oMc;
      translation_.buildFrom(cdMc);
      rotation_.buildFrom(cdMc);
    } else {
      set_points(points_, stack::numbers(now, "pixels"), oMc);
    }
    const std::vector<double> J = stack::numbers(now, "jacobian");
    const unsigned n = static_cast<unsigned>(J.size() / 6);
    vpMatrix eJe(6, n);
    for (unsigned i = 0; i < 6; ++i)
      for (unsigned j = 0; j < n; ++j) eJe[i][j] = J[i * n + j];
    task_.set_eJe(eJe);
    vpColVector qd = task_.computeControlLaw();
    if (avoids_) {
      const vpColVector q = column(stack::numbers(now, "q"));
      qd += task_.secondaryTaskJointLimitAvoidance(q, qd, lower_, upper_, rho_, rho1_, tune_);
    }
    double excess = 1.0;
    for (unsigned j = 0; j < n && saturates_; ++j)
      excess = std::max(excess, std::fabs(qd[j]) / fastest_[j]);
    std::vector<double> out(n);
    for (unsigned j = 0; j < n; ++j) out[j] = qd[j] / excess;
    return out;
  }

 private:
  void set_goal(std::size_t goal) {
    if (goal == goal_) return;
    goal_ = goal;
    std::size_t at = goals_;
    for (std::size_t i = 0; i <= goal; ++i) at = setup_.find("\"from\":", at + 1);
    const vpHomogeneousMatrix oMcd = pose(stack::numbers(setup_, "camera_in_target", at));
    cdMo_ = oMcd.inverse();
    if (!by_pose_) set_points(points_at_goal_, stack::numbers(setup_, "pixels", at), oMcd);
  }

  void set_points(std::deque<vpFeaturePoint>& points, const std::vector<double>& pixels,
                  const vpHomogeneousMatrix& oMc) const {
    for (std::size_t i = 0; i < points.size(); ++i) {
      double Z = 0.0;
      for (unsigned k = 0; k < 3; ++k) Z += (markers_[3 * i + k] - oMc[k][3]) * oMc[k][2];
      const double x = (pixels[2 * i] - camera_[2]) / camera_[0];
      const double y = (pixels[2 * i + 1] - camera_[3]) / camera_[1];
      points[i].buildFrom(x, y, Z);
    }
  }

  std::vector<double> camera_, markers_;
  std::size_t goals_;
  const std::string setup_;
  bool by_pose_, avoids_ = false, saturates_ = true;
  double rho_ = 0.1, rho1_ = 0.3, tune_ = 0.7;
  std::size_t goal_ = static_cast<std::size_t>(-1);
  vpColVector lower_, upper_, fastest_;
  vpHomogeneousMatrix cdMo_;
  vpFeatureTranslation translation_{vpFeatureTranslation::cdMc};
  vpFeatureTranslation translation_at_goal_{vpFeatureTranslation::cdMc};
  vpFeatureThetaU rotation_{vpFeatureThetaU::cdRc};
  vpFeatureThetaU rotation_at_goal_{vpFeatureThetaU::cdRc};
  std::deque<vpFeaturePoint> points_, points_at_goal_;
  vpServo task_;
};

}  // namespace

int main() {
  std::cout.precision(17);
  std::cout << R"({"protocol":1,"name":"ViSP )" << VISP_VERSION_MAJOR << "." << VISP_VERSION_MINOR
            << "." << VISP_VERSION_PATCH << R"(","output":"velocity",)"
            << R"("uses":["limits","camera","target","goals","q","pixels","pose","jacobian"]})"
            << std::endl;
  std::string line;
  std::getline(std::cin, line);
  if (!std::cin) return 0;
  try {
    check(line);
    Servo servo(line);
    while (std::getline(std::cin, line)) {
      const auto begun = std::chrono::steady_clock::now();
      const std::vector<double> velocity = servo.step(line);
      const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begun;
      stack::answer(velocity, passed.count());
    }
  } catch (const std::exception& error) {
    std::cerr << error.what() << std::endl;
    return 1;
  }
}

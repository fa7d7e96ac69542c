/* mems_hexapod_online_f32: see mems_hexapod_online_f32.h. Made by ctrlgen 0.1.0; do not edit. */
#include "mems_hexapod_online_f32.h"

#include <stddef.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0)) || defined(_M_FP_FAST)
#error "compile this without -ffast-math, -Ofast, -ffinite-math-only or /fp:fast: they remove the checks for NaN"
#endif

static const float U_LOW[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }; /* W */
static const float U_HIGH[6] = { 1.0f, 1.0f, 1.0f, 1.0f, 1.0f, 1.0f }; /* W */
static const float U_SLACK[6] = { 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f, 4.012113e-06f }; /* W */
static const float U_SAFE[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }; /* W */
static const float X_REST[6] = { 295.15f, 295.15f, 295.15f, 295.15f, 295.15f, 295.15f }; /* temperature_1X [K], temperature_1Y [K], temperature_2X [K], temperature_2Y [K], temperature_3X [K], temperature_3Y [K] */

#define READY (0xA500A500U) /* in a state that was initialised; zeros and most other bytes are not this word */

/* Square root by Newton steps; 0 for 0, for negative numbers and for what is not a number. */
static float root(float a)
{
    union { float number; uint32_t bits; } guess;
    const float h = 0.5f * a;
    float y;
    float s;
    guess.number = a;
    guess.bits = 0x5F3759DFU - (guess.bits >> 1U);
    y = guess.number;
    y = y * (1.5f - ((h * y) * y));
    y = y * (1.5f - ((h * y) * y));
    s = a * y;
    s = s + ((0.5f * y) * (a - (s * s)));
    return (a > 0.0f) ? s : 0.0f;
}

static void wanted_displacement(const float target[6], float result[6])
{
    const float t6 = ((-0.0026423377f) * target[0]) - (0.0037076124f * target[1]);
    const float t10 = t6 + (0.0041873017f * target[2]);
    const float t14 = t10 + target[3];
    const float t18 = t14 + (0.64624566f * target[5]);
    const float t24 = (0.0006915413f * target[0]) + (0.0026864675f * target[1]);
    const float t27 = t24 - (0.002447848f * target[2]);
    const float t31 = t27 + target[4];
    const float t34 = t31 + (1.1192472f * target[5]);
    const float t40 = (0.0041421377f * target[1]) - (0.0018897178f * target[0]);
    const float t43 = t40 + (0.0041873017f * target[2]);
    const float t46 = t43 - (0.5f * target[3]);
    const float t49 = t46 - (0.8660254f * target[4]);
    const float t52 = t49 + (0.64624566f * target[5]);
    const float t58 = (0.0019807783f * target[0]) - (0.0019421261f * target[1]);
    const float t61 = t58 - (0.002447848f * target[2]);
    const float t64 = t61 + (0.8660254f * target[3]);
    const float t67 = t64 - (0.5f * target[4]);
    const float t70 = t67 + (1.1192472f * target[5]);
    const float t76 = (0.0045320555f * target[0]) - (0.00043452534f * target[1]);
    const float t79 = t76 + (0.0041873017f * target[2]);
    const float t82 = t79 - (0.5f * target[3]);
    const float t85 = t82 + (0.8660254f * target[4]);
    const float t88 = t85 + (0.64624566f * target[5]);
    const float t94 = ((-0.0026723198f) * target[0]) - (0.00074434135f * target[1]);
    const float t97 = t94 - (0.002447848f * target[2]);
    const float t100 = t97 - (0.8660254f * target[3]);
    const float t103 = t100 - (0.5f * target[4]);
    const float t106 = t103 + (1.1192472f * target[5]);
    result[0] = t18;
    result[1] = t34;
    result[2] = t52;
    result[3] = t70;
    result[4] = t88;
    result[5] = t106;
}

static void wanted_state(const float wanted[6], float result[6])
{
    const float t10 = wanted[0] * wanted[0];
    const float t11 = 1e-06f - t10;
    const float t12_0 = 0.0004996048f + (500.3872f * t11);
    const float t12 = 0.5f * (t12_0 + (t11 / t12_0));
    const float t14 = wanted[0] * t12;
    const float t15 = 0.001f + t12;
    const float t16 = t10 / t15;
    const float t17 = t14 * t16;
    const float t18 = (1895.5361f * wanted[0]) + (1.03154e+12f * t17);
    const float t24 = 2.9544324e-07f + (2.1273852e-06f * t18);
    const float t27_0 = 0.00033309363f + (732.52997f * t24);
    const float t27_1 = 0.5f * (t27_0 + (t24 / t27_0));
    const float t27 = 0.5f * (t27_1 + (t24 / t27_1));
    const float t28 = 0.0005435469f + t27;
    const float t29 = t18 / t28;
    const float t30 = 295.15f + (2.0f * t29);
    const float t36 = wanted[1] * wanted[1];
    const float t37 = 1e-06f - t36;
    const float t38_0 = 0.0004996048f + (500.3872f * t37);
    const float t38 = 0.5f * (t38_0 + (t37 / t38_0));
    const float t40 = wanted[1] * t38;
    const float t41 = 0.001f + t38;
    const float t42 = t36 / t41;
    const float t43 = t40 * t42;
    const float t44 = (1895.5361f * wanted[1]) + (1.03154e+12f * t43);
    const float t47 = 2.9544324e-07f + (2.1273852e-06f * t44);
    const float t49_0 = 0.00033309363f + (732.52997f * t47);
    const float t49_1 = 0.5f * (t49_0 + (t47 / t49_0));
    const float t49 = 0.5f * (t49_1 + (t47 / t49_1));
    const float t50 = 0.0005435469f + t49;
    const float t51 = t44 / t50;
    const float t52 = 295.15f + (2.0f * t51);
    const float t58 = wanted[2] * wanted[2];
    const float t59 = 1e-06f - t58;
    const float t60_0 = 0.0004996048f + (500.3872f * t59);
    const float t60 = 0.5f * (t60_0 + (t59 / t60_0));
    const float t62 = wanted[2] * t60;
    const float t63 = 0.001f + t60;
    const float t64 = t58 / t63;
    const float t65 = t62 * t64;
    const float t66 = (1895.5361f * wanted[2]) + (1.03154e+12f * t65);
    const float t69 = 2.9544324e-07f + (2.1273852e-06f * t66);
    const float t71_0 = 0.00033309363f + (732.52997f * t69);
    const float t71_1 = 0.5f * (t71_0 + (t69 / t71_0));
    const float t71 = 0.5f * (t71_1 + (t69 / t71_1));
    const float t72 = 0.0005435469f + t71;
    const float t73 = t66 / t72;
    const float t74 = 295.15f + (2.0f * t73);
    const float t80 = wanted[3] * wanted[3];
    const float t81 = 1e-06f - t80;
    const float t82_0 = 0.0004996048f + (500.3872f * t81);
    const float t82 = 0.5f * (t82_0 + (t81 / t82_0));
    const float t84 = wanted[3] * t82;
    const float t85 = 0.001f + t82;
    const float t86 = t80 / t85;
    const float t87 = t84 * t86;
    const float t88 = (1895.5361f * wanted[3]) + (1.03154e+12f * t87);
    const float t91 = 2.9544324e-07f + (2.1273852e-06f * t88);
    const float t93_0 = 0.00033309363f + (732.52997f * t91);
    const float t93_1 = 0.5f * (t93_0 + (t91 / t93_0));
    const float t93 = 0.5f * (t93_1 + (t91 / t93_1));
    const float t94 = 0.0005435469f + t93;
    const float t95 = t88 / t94;
    const float t96 = 295.15f + (2.0f * t95);
    const float t102 = wanted[4] * wanted[4];
    const float t103 = 1e-06f - t102;
    const float t104_0 = 0.0004996048f + (500.3872f * t103);
    const float t104 = 0.5f * (t104_0 + (t103 / t104_0));
    const float t106 = wanted[4] * t104;
    const float t107 = 0.001f + t104;
    const float t108 = t102 / t107;
    const float t109 = t106 * t108;
    const float t110 = (1895.5361f * wanted[4]) + (1.03154e+12f * t109);
    const float t113 = 2.9544324e-07f + (2.1273852e-06f * t110);
    const float t115_0 = 0.00033309363f + (732.52997f * t113);
    const float t115_1 = 0.5f * (t115_0 + (t113 / t115_0));
    const float t115 = 0.5f * (t115_1 + (t113 / t115_1));
    const float t116 = 0.0005435469f + t115;
    const float t117 = t110 / t116;
    const float t118 = 295.15f + (2.0f * t117);
    const float t124 = wanted[5] * wanted[5];
    const float t125 = 1e-06f - t124;
    const float t126_0 = 0.0004996048f + (500.3872f * t125);
    const float t126 = 0.5f * (t126_0 + (t125 / t126_0));
    const float t128 = wanted[5] * t126;
    const float t129 = 0.001f + t126;
    const float t130 = t124 / t129;
    const float t131 = t128 * t130;
    const float t132 = (1895.5361f * wanted[5]) + (1.03154e+12f * t131);
    const float t135 = 2.9544324e-07f + (2.1273852e-06f * t132);
    const float t137_0 = 0.00033309363f + (732.52997f * t135);
    const float t137_1 = 0.5f * (t137_0 + (t135 / t137_0));
    const float t137 = 0.5f * (t137_1 + (t135 / t137_1));
    const float t138 = 0.0005435469f + t137;
    const float t139 = t132 / t138;
    const float t140 = 295.15f + (2.0f * t139);
    result[0] = t30;
    result[1] = t52;
    result[2] = t74;
    result[3] = t96;
    result[4] = t118;
    result[5] = t140;
}

static void wanted_drive(const float state[6], float result[6])
{
    const float t3 = state[0] - 295.15f;
    const float t9 = state[1] - 295.15f;
    const float t14 = state[2] - 295.15f;
    const float t19 = state[3] - 295.15f;
    const float t24 = state[4] - 295.15f;
    const float t29 = state[5] - 295.15f;
    result[0] = (0.0018181818f * t3);
    result[1] = (0.0018181818f * t9);
    result[2] = (0.0018181818f * t14);
    result[3] = (0.0018181818f * t19);
    result[4] = (0.0018181818f * t24);
    result[5] = (0.0018181818f * t29);
}

static void wanted_advance(const float drive[6], float result[6])
{
    const float t8 = 295.15f + (550.0f * drive[0]);
    const float t14 = 295.15f + (550.0f * drive[1]);
    const float t20 = 295.15f + (550.0f * drive[2]);
    const float t26 = 295.15f + (550.0f * drive[3]);
    const float t32 = 295.15f + (550.0f * drive[4]);
    const float t38 = 295.15f + (550.0f * drive[5]);
    result[0] = t8;
    result[1] = t14;
    result[2] = t20;
    result[3] = t26;
    result[4] = t32;
    result[5] = t38;
}

static void step_drive(const float x[6], const float state[6], float result[6])
{
    const float t5 = x[0] - 295.15f;
    const float t9 = x[0] - (0.18126924f * t5);
    const float t10 = state[0] - t9;
    const float t16 = x[1] - 295.15f;
    const float t19 = x[1] - (0.18126924f * t16);
    const float t20 = state[1] - t19;
    const float t26 = x[2] - 295.15f;
    const float t29 = x[2] - (0.18126924f * t26);
    const float t30 = state[2] - t29;
    const float t36 = x[3] - 295.15f;
    const float t39 = x[3] - (0.18126924f * t36);
    const float t40 = state[3] - t39;
    const float t46 = x[4] - 295.15f;
    const float t49 = x[4] - (0.18126924f * t46);
    const float t50 = state[4] - t49;
    const float t56 = x[5] - 295.15f;
    const float t59 = x[5] - (0.18126924f * t56);
    const float t60 = state[5] - t59;
    result[0] = (0.010030283f * t10);
    result[1] = (0.010030283f * t20);
    result[2] = (0.010030283f * t30);
    result[3] = (0.010030283f * t40);
    result[4] = (0.010030283f * t50);
    result[5] = (0.010030283f * t60);
}

static void step_advance(const float x[6], const float drive[6], float result[6])
{
    const float t6 = x[0] - 295.15f;
    const float t7 = (550.0f * drive[0]) - t6;
    const float t11 = x[0] + (0.18126924f * t7);
    const float t16 = x[1] - 295.15f;
    const float t17 = (550.0f * drive[1]) - t16;
    const float t20 = x[1] + (0.18126924f * t17);
    const float t25 = x[2] - 295.15f;
    const float t26 = (550.0f * drive[2]) - t25;
    const float t29 = x[2] + (0.18126924f * t26);
    const float t34 = x[3] - 295.15f;
    const float t35 = (550.0f * drive[3]) - t34;
    const float t38 = x[3] + (0.18126924f * t35);
    const float t43 = x[4] - 295.15f;
    const float t44 = (550.0f * drive[4]) - t43;
    const float t47 = x[4] + (0.18126924f * t44);
    const float t52 = x[5] - 295.15f;
    const float t53 = (550.0f * drive[5]) - t52;
    const float t56 = x[5] + (0.18126924f * t53);
    result[0] = t11;
    result[1] = t20;
    result[2] = t29;
    result[3] = t38;
    result[4] = t47;
    result[5] = t56;
}

static void balance_displacement(const float x[6], const float z[6], float result[6])
{
    const float t6 = x[0] - 273.15f;
    const float t8 = 3e-06f + (3e-09f * t6);
    const float t10 = x[0] - 295.15f;
    const float t11 = t8 * t10;
    const float t12 = 177.2821f * t11;
    const float t18 = 1.03154003e+09f * z[0];
    const float t20 = z[0] * z[0];
    const float t21 = 1e-06f - t20;
    const float t22_0 = 0.0004996048f + (500.3872f * t21);
    const float t22 = 0.5f * (t22_0 + (t21 / t22_0));
    const float t23 = 1000.0f * t22;
    const float t24 = t18 * t23;
    const float t25 = 0.001f + t22;
    const float t26 = t20 / t25;
    const float t27 = t24 * t26;
    const float t28 = (1895.5361f * z[0]) + t27;
    const float t29 = t12 - t28;
    const float t33 = z[0] / t22;
    const float t35 = t18 * t33;
    const float t36 = (1.03154003e+09f * t23) - (1000.0f * t35);
    const float t37 = t26 * t36;
    const float t39 = z[0] / t25;
    const float t40 = t26 / t25;
    const float t41 = t40 * t33;
    const float t42 = (2.0f * t39) + t41;
    const float t43 = t24 * t42;
    const float t44 = t37 + t43;
    const float t45 = 1895.5361f + t44;
    const float t46 = t29 / t45;
    const float t47 = z[0] + t46;
    const float t50 = 1.03154003e+09f * t47;
    const float t51 = t47 * t47;
    const float t52 = 1e-06f - t51;
    const float t53_0 = 0.0004894548f + (510.5982f * t52);
    const float t53 = 0.5f * (t53_0 + (t52 / t53_0));
    const float t54 = 1000.0f * t53;
    const float t55 = t50 * t54;
    const float t56 = 0.001f + t53;
    const float t57 = t51 / t56;
    const float t58 = t55 * t57;
    const float t59 = (1895.5361f * t47) + t58;
    const float t60 = t12 - t59;
    const float t62 = t47 / t53;
    const float t64 = t50 * t62;
    const float t65 = (1.03154003e+09f * t54) - (1000.0f * t64);
    const float t66 = t57 * t65;
    const float t68 = t47 / t56;
    const float t69 = t57 / t56;
    const float t70 = t69 * t62;
    const float t71 = (2.0f * t68) + t70;
    const float t72 = t55 * t71;
    const float t73 = t66 + t72;
    const float t74 = 1895.5361f + t73;
    const float t75 = t60 / t74;
    const float t76 = t47 + t75;
    const float t79 = 1.03154003e+09f * t76;
    const float t80 = t76 * t76;
    const float t81 = 1e-06f - t80;
    const float t82 = root(t81);
    const float t83 = 1000.0f * t82;
    const float t84 = t79 * t83;
    const float t85 = 0.001f + t82;
    const float t86 = t80 / t85;
    const float t87 = t84 * t86;
    const float t88 = (1895.5361f * t76) + t87;
    const float t89 = t12 - t88;
    const float t91 = t76 / t82;
    const float t93 = t79 * (1000.0f * t91);
    const float t94 = (1.03154003e+09f * t83) - t93;
    const float t95 = t86 * t94;
    const float t97 = (2.0f * t76) / t85;
    const float t98 = t86 / t85;
    const float t99 = t98 * t91;
    const float t100 = t97 + t99;
    const float t101 = t84 * t100;
    const float t102 = t95 + t101;
    const float t103 = 1895.5361f + t102;
    const float t104 = t89 / t103;
    const float t105 = t76 + t104;
    const float t108 = 1.03154003e+09f * t105;
    const float t109 = t105 * t105;
    const float t110 = 1e-06f - t109;
    const float t111 = root(t110);
    const float t112 = 1000.0f * t111;
    const float t113 = t108 * t112;
    const float t114 = 0.001f + t111;
    const float t115 = t109 / t114;
    const float t116 = t113 * t115;
    const float t117 = (1895.5361f * t105) + t116;
    const float t118 = t12 - t117;
    const float t120 = t105 / t111;
    const float t122 = t108 * (1000.0f * t120);
    const float t123 = (1.03154003e+09f * t112) - t122;
    const float t124 = t115 * t123;
    const float t126 = (2.0f * t105) / t114;
    const float t127 = t115 / t114;
    const float t128 = t127 * t120;
    const float t129 = t126 + t128;
    const float t130 = t113 * t129;
    const float t131 = t124 + t130;
    const float t132 = 1895.5361f + t131;
    const float t133 = t118 / t132;
    const float t134 = t105 + t133;
    const float t137 = 1.03154003e+09f * t134;
    const float t138 = t134 * t134;
    const float t139 = 1e-06f - t138;
    const float t140 = root(t139);
    const float t141 = 1000.0f * t140;
    const float t142 = t137 * t141;
    const float t143 = 0.001f + t140;
    const float t144 = t138 / t143;
    const float t145 = t142 * t144;
    const float t146 = (1895.5361f * t134) + t145;
    const float t147 = t12 - t146;
    const float t149 = t134 / t140;
    const float t151 = t137 * (1000.0f * t149);
    const float t152 = (1.03154003e+09f * t141) - t151;
    const float t153 = t144 * t152;
    const float t155 = (2.0f * t134) / t143;
    const float t156 = t144 / t143;
    const float t157 = t156 * t149;
    const float t158 = t155 + t157;
    const float t159 = t142 * t158;
    const float t160 = t153 + t159;
    const float t161 = 1895.5361f + t160;
    const float t162 = t147 / t161;
    const float t163 = t134 + t162;
    const float t166 = 1.03154003e+09f * t163;
    const float t167 = t163 * t163;
    const float t168 = 1e-06f - t167;
    const float t169 = root(t168);
    const float t170 = 1000.0f * t169;
    const float t171 = t166 * t170;
    const float t172 = 0.001f + t169;
    const float t173 = t167 / t172;
    const float t174 = t171 * t173;
    const float t175 = (1895.5361f * t163) + t174;
    const float t176 = t12 - t175;
    const float t178 = t163 / t169;
    const float t180 = t166 * (1000.0f * t178);
    const float t181 = (1.03154003e+09f * t170) - t180;
    const float t182 = t173 * t181;
    const float t184 = (2.0f * t163) / t172;
    const float t185 = t173 / t172;
    const float t186 = t185 * t178;
    const float t187 = t184 + t186;
    const float t188 = t171 * t187;
    const float t189 = t182 + t188;
    const float t190 = 1895.5361f + t189;
    const float t191 = t176 / t190;
    const float t192 = t163 + t191;
    const float t196 = x[1] - 273.15f;
    const float t198 = 3e-06f + (3e-09f * t196);
    const float t199 = x[1] - 295.15f;
    const float t200 = t198 * t199;
    const float t201 = 177.2821f * t200;
    const float t204 = 1.03154003e+09f * z[1];
    const float t205 = z[1] * z[1];
    const float t206 = 1e-06f - t205;
    const float t207_0 = 0.0004996048f + (500.3872f * t206);
    const float t207 = 0.5f * (t207_0 + (t206 / t207_0));
    const float t208 = 1000.0f * t207;
    const float t209 = t204 * t208;
    const float t210 = 0.001f + t207;
    const float t211 = t205 / t210;
    const float t212 = t209 * t211;
    const float t213 = (1895.5361f * z[1]) + t212;
    const float t214 = t201 - t213;
    const float t216 = z[1] / t207;
    const float t218 = t204 * t216;
    const float t219 = (1.03154003e+09f * t208) - (1000.0f * t218);
    const float t220 = t211 * t219;
    const float t222 = z[1] / t210;
    const float t223 = t211 / t210;
    const float t224 = t223 * t216;
    const float t225 = (2.0f * t222) + t224;
    const float t226 = t209 * t225;
    const float t227 = t220 + t226;
    const float t228 = 1895.5361f + t227;
    const float t229 = t214 / t228;
    const float t230 = z[1] + t229;
    const float t233 = 1.03154003e+09f * t230;
    const float t234 = t230 * t230;
    const float t235 = 1e-06f - t234;
    const float t236_0 = 0.0004894548f + (510.5982f * t235);
    const float t236 = 0.5f * (t236_0 + (t235 / t236_0));
    const float t237 = 1000.0f * t236;
    const float t238 = t233 * t237;
    const float t239 = 0.001f + t236;
    const float t240 = t234 / t239;
    const float t241 = t238 * t240;
    const float t242 = (1895.5361f * t230) + t241;
    const float t243 = t201 - t242;
    const float t245 = t230 / t236;
    const float t247 = t233 * t245;
    const float t248 = (1.03154003e+09f * t237) - (1000.0f * t247);
    const float t249 = t240 * t248;
    const float t251 = t230 / t239;
    const float t252 = t240 / t239;
    const float t253 = t252 * t245;
    const float t254 = (2.0f * t251) + t253;
    const float t255 = t238 * t254;
    const float t256 = t249 + t255;
    const float t257 = 1895.5361f + t256;
    const float t258 = t243 / t257;
    const float t259 = t230 + t258;
    const float t262 = 1.03154003e+09f * t259;
    const float t263 = t259 * t259;
    const float t264 = 1e-06f - t263;
    const float t265 = root(t264);
    const float t266 = 1000.0f * t265;
    const float t267 = t262 * t266;
    const float t268 = 0.001f + t265;
    const float t269 = t263 / t268;
    const float t270 = t267 * t269;
    const float t271 = (1895.5361f * t259) + t270;
    const float t272 = t201 - t271;
    const float t274 = t259 / t265;
    const float t276 = t262 * (1000.0f * t274);
    const float t277 = (1.03154003e+09f * t266) - t276;
    const float t278 = t269 * t277;
    const float t280 = (2.0f * t259) / t268;
    const float t281 = t269 / t268;
    const float t282 = t281 * t274;
    const float t283 = t280 + t282;
    const float t284 = t267 * t283;
    const float t285 = t278 + t284;
    const float t286 = 1895.5361f + t285;
    const float t287 = t272 / t286;
    const float t288 = t259 + t287;
    const float t291 = 1.03154003e+09f * t288;
    const float t292 = t288 * t288;
    const float t293 = 1e-06f - t292;
    const float t294 = root(t293);
    const float t295 = 1000.0f * t294;
    const float t296 = t291 * t295;
    const float t297 = 0.001f + t294;
    const float t298 = t292 / t297;
    const float t299 = t296 * t298;
    const float t300 = (1895.5361f * t288) + t299;
    const float t301 = t201 - t300;
    const float t303 = t288 / t294;
    const float t305 = t291 * (1000.0f * t303);
    const float t306 = (1.03154003e+09f * t295) - t305;
    const float t307 = t298 * t306;
    const float t309 = (2.0f * t288) / t297;
    const float t310 = t298 / t297;
    const float t311 = t310 * t303;
    const float t312 = t309 + t311;
    const float t313 = t296 * t312;
    const float t314 = t307 + t313;
    const float t315 = 1895.5361f + t314;
    const float t316 = t301 / t315;
    const float t317 = t288 + t316;
    const float t320 = 1.03154003e+09f * t317;
    const float t321 = t317 * t317;
    const float t322 = 1e-06f - t321;
    const float t323 = root(t322);
    const float t324 = 1000.0f * t323;
    const float t325 = t320 * t324;
    const float t326 = 0.001f + t323;
    const float t327 = t321 / t326;
    const float t328 = t325 * t327;
    const float t329 = (1895.5361f * t317) + t328;
    const float t330 = t201 - t329;
    const float t332 = t317 / t323;
    const float t334 = t320 * (1000.0f * t332);
    const float t335 = (1.03154003e+09f * t324) - t334;
    const float t336 = t327 * t335;
    const float t338 = (2.0f * t317) / t326;
    const float t339 = t327 / t326;
    const float t340 = t339 * t332;
    const float t341 = t338 + t340;
    const float t342 = t325 * t341;
    const float t343 = t336 + t342;
    const float t344 = 1895.5361f + t343;
    const float t345 = t330 / t344;
    const float t346 = t317 + t345;
    const float t349 = 1.03154003e+09f * t346;
    const float t350 = t346 * t346;
    const float t351 = 1e-06f - t350;
    const float t352 = root(t351);
    const float t353 = 1000.0f * t352;
    const float t354 = t349 * t353;
    const float t355 = 0.001f + t352;
    const float t356 = t350 / t355;
    const float t357 = t354 * t356;
    const float t358 = (1895.5361f * t346) + t357;
    const float t359 = t201 - t358;
    const float t361 = t346 / t352;
    const float t363 = t349 * (1000.0f * t361);
    const float t364 = (1.03154003e+09f * t353) - t363;
    const float t365 = t356 * t364;
    const float t367 = (2.0f * t346) / t355;
    const float t368 = t356 / t355;
    const float t369 = t368 * t361;
    const float t370 = t367 + t369;
    const float t371 = t354 * t370;
    const float t372 = t365 + t371;
    const float t373 = 1895.5361f + t372;
    const float t374 = t359 / t373;
    const float t375 = t346 + t374;
    const float t379 = x[2] - 273.15f;
    const float t381 = 3e-06f + (3e-09f * t379);
    const float t382 = x[2] - 295.15f;
    const float t383 = t381 * t382;
    const float t384 = 177.2821f * t383;
    const float t387 = 1.03154003e+09f * z[2];
    const float t388 = z[2] * z[2];
    const float t389 = 1e-06f - t388;
    const float t390_0 = 0.0004996048f + (500.3872f * t389);
    const float t390 = 0.5f * (t390_0 + (t389 / t390_0));
    const float t391 = 1000.0f * t390;
    const float t392 = t387 * t391;
    const float t393 = 0.001f + t390;
    const float t394 = t388 / t393;
    const float t395 = t392 * t394;
    const float t396 = (1895.5361f * z[2]) + t395;
    const float t397 = t384 - t396;
    const float t399 = z[2] / t390;
    const float t401 = t387 * t399;
    const float t402 = (1.03154003e+09f * t391) - (1000.0f * t401);
    const float t403 = t394 * t402;
    const float t405 = z[2] / t393;
    const float t406 = t394 / t393;
    const float t407 = t406 * t399;
    const float t408 = (2.0f * t405) + t407;
    const float t409 = t392 * t408;
    const float t410 = t403 + t409;
    const float t411 = 1895.5361f + t410;
    const float t412 = t397 / t411;
    const float t413 = z[2] + t412;
    const float t416 = 1.03154003e+09f * t413;
    const float t417 = t413 * t413;
    const float t418 = 1e-06f - t417;
    const float t419_0 = 0.0004894548f + (510.5982f * t418);
    const float t419 = 0.5f * (t419_0 + (t418 / t419_0));
    const float t420 = 1000.0f * t419;
    const float t421 = t416 * t420;
    const float t422 = 0.001f + t419;
    const float t423 = t417 / t422;
    const float t424 = t421 * t423;
    const float t425 = (1895.5361f * t413) + t424;
    const float t426 = t384 - t425;
    const float t428 = t413 / t419;
    const float t430 = t416 * t428;
    const float t431 = (1.03154003e+09f * t420) - (1000.0f * t430);
    const float t432 = t423 * t431;
    const float t434 = t413 / t422;
    const float t435 = t423 / t422;
    const float t436 = t435 * t428;
    const float t437 = (2.0f * t434) + t436;
    const float t438 = t421 * t437;
    const float t439 = t432 + t438;
    const float t440 = 1895.5361f + t439;
    const float t441 = t426 / t440;
    const float t442 = t413 + t441;
    const float t445 = 1.03154003e+09f * t442;
    const float t446 = t442 * t442;
    const float t447 = 1e-06f - t446;
    const float t448 = root(t447);
    const float t449 = 1000.0f * t448;
    const float t450 = t445 * t449;
    const float t451 = 0.001f + t448;
    const float t452 = t446 / t451;
    const float t453 = t450 * t452;
    const float t454 = (1895.5361f * t442) + t453;
    const float t455 = t384 - t454;
    const float t457 = t442 / t448;
    const float t459 = t445 * (1000.0f * t457);
    const float t460 = (1.03154003e+09f * t449) - t459;
    const float t461 = t452 * t460;
    const float t463 = (2.0f * t442) / t451;
    const float t464 = t452 / t451;
    const float t465 = t464 * t457;
    const float t466 = t463 + t465;
    const float t467 = t450 * t466;
    const float t468 = t461 + t467;
    const float t469 = 1895.5361f + t468;
    const float t470 = t455 / t469;
    const float t471 = t442 + t470;
    const float t474 = 1.03154003e+09f * t471;
    const float t475 = t471 * t471;
    const float t476 = 1e-06f - t475;
    const float t477 = root(t476);
    const float t478 = 1000.0f * t477;
    const float t479 = t474 * t478;
    const float t480 = 0.001f + t477;
    const float t481 = t475 / t480;
    const float t482 = t479 * t481;
    const float t483 = (1895.5361f * t471) + t482;
    const float t484 = t384 - t483;
    const float t486 = t471 / t477;
    const float t488 = t474 * (1000.0f * t486);
    const float t489 = (1.03154003e+09f * t478) - t488;
    const float t490 = t481 * t489;
    const float t492 = (2.0f * t471) / t480;
    const float t493 = t481 / t480;
    const float t494 = t493 * t486;
    const float t495 = t492 + t494;
    const float t496 = t479 * t495;
    const float t497 = t490 + t496;
    const float t498 = 1895.5361f + t497;
    const float t499 = t484 / t498;
    const float t500 = t471 + t499;
    const float t503 = 1.03154003e+09f * t500;
    const float t504 = t500 * t500;
    const float t505 = 1e-06f - t504;
    const float t506 = root(t505);
    const float t507 = 1000.0f * t506;
    const float t508 = t503 * t507;
    const float t509 = 0.001f + t506;
    const float t510 = t504 / t509;
    const float t511 = t508 * t510;
    const float t512 = (1895.5361f * t500) + t511;
    const float t513 = t384 - t512;
    const float t515 = t500 / t506;
    const float t517 = t503 * (1000.0f * t515);
    const float t518 = (1.03154003e+09f * t507) - t517;
    const float t519 = t510 * t518;
    const float t521 = (2.0f * t500) / t509;
    const float t522 = t510 / t509;
    const float t523 = t522 * t515;
    const float t524 = t521 + t523;
    const float t525 = t508 * t524;
    const float t526 = t519 + t525;
    const float t527 = 1895.5361f + t526;
    const float t528 = t513 / t527;
    const float t529 = t500 + t528;
    const float t532 = 1.03154003e+09f * t529;
    const float t533 = t529 * t529;
    const float t534 = 1e-06f - t533;
    const float t535 = root(t534);
    const float t536 = 1000.0f * t535;
    const float t537 = t532 * t536;
    const float t538 = 0.001f + t535;
    const float t539 = t533 / t538;
    const float t540 = t537 * t539;
    const float t541 = (1895.5361f * t529) + t540;
    const float t542 = t384 - t541;
    const float t544 = t529 / t535;
    const float t546 = t532 * (1000.0f * t544);
    const float t547 = (1.03154003e+09f * t536) - t546;
    const float t548 = t539 * t547;
    const float t550 = (2.0f * t529) / t538;
    const float t551 = t539 / t538;
    const float t552 = t551 * t544;
    const float t553 = t550 + t552;
    const float t554 = t537 * t553;
    const float t555 = t548 + t554;
    const float t556 = 1895.5361f + t555;
    const float t557 = t542 / t556;
    const float t558 = t529 + t557;
    const float t562 = x[3] - 273.15f;
    const float t564 = 3e-06f + (3e-09f * t562);
    const float t565 = x[3] - 295.15f;
    const float t566 = t564 * t565;
    const float t567 = 177.2821f * t566;
    const float t570 = 1.03154003e+09f * z[3];
    const float t571 = z[3] * z[3];
    const float t572 = 1e-06f - t571;
    const float t573_0 = 0.0004996048f + (500.3872f * t572);
    const float t573 = 0.5f * (t573_0 + (t572 / t573_0));
    const float t574 = 1000.0f * t573;
    const float t575 = t570 * t574;
    const float t576 = 0.001f + t573;
    const float t577 = t571 / t576;
    const float t578 = t575 * t577;
    const float t579 = (1895.5361f * z[3]) + t578;
    const float t580 = t567 - t579;
    const float t582 = z[3] / t573;
    const float t584 = t570 * t582;
    const float t585 = (1.03154003e+09f * t574) - (1000.0f * t584);
    const float t586 = t577 * t585;
    const float t588 = z[3] / t576;
    const float t589 = t577 / t576;
    const float t590 = t589 * t582;
    const float t591 = (2.0f * t588) + t590;
    const float t592 = t575 * t591;
    const float t593 = t586 + t592;
    const float t594 = 1895.5361f + t593;
    const float t595 = t580 / t594;
    const float t596 = z[3] + t595;
    const float t599 = 1.03154003e+09f * t596;
    const float t600 = t596 * t596;
    const float t601 = 1e-06f - t600;
    const float t602_0 = 0.0004894548f + (510.5982f * t601);
    const float t602 = 0.5f * (t602_0 + (t601 / t602_0));
    const float t603 = 1000.0f * t602;
    const float t604 = t599 * t603;
    const float t605 = 0.001f + t602;
    const float t606 = t600 / t605;
    const float t607 = t604 * t606;
    const float t608 = (1895.5361f * t596) + t607;
    const float t609 = t567 - t608;
    const float t611 = t596 / t602;
    const float t613 = t599 * t611;
    const float t614 = (1.03154003e+09f * t603) - (1000.0f * t613);
    const float t615 = t606 * t614;
    const float t617 = t596 / t605;
    const float t618 = t606 / t605;
    const float t619 = t618 * t611;
    const float t620 = (2.0f * t617) + t619;
    const float t621 = t604 * t620;
    const float t622 = t615 + t621;
    const float t623 = 1895.5361f + t622;
    const float t624 = t609 / t623;
    const float t625 = t596 + t624;
    const float t628 = 1.03154003e+09f * t625;
    const float t629 = t625 * t625;
    const float t630 = 1e-06f - t629;
    const float t631 = root(t630);
    const float t632 = 1000.0f * t631;
    const float t633 = t628 * t632;
    const float t634 = 0.001f + t631;
    const float t635 = t629 / t634;
    const float t636 = t633 * t635;
    const float t637 = (1895.5361f * t625) + t636;
    const float t638 = t567 - t637;
    const float t640 = t625 / t631;
    const float t642 = t628 * (1000.0f * t640);
    const float t643 = (1.03154003e+09f * t632) - t642;
    const float t644 = t635 * t643;
    const float t646 = (2.0f * t625) / t634;
    const float t647 = t635 / t634;
    const float t648 = t647 * t640;
    const float t649 = t646 + t648;
    const float t650 = t633 * t649;
    const float t651 = t644 + t650;
    const float t652 = 1895.5361f + t651;
    const float t653 = t638 / t652;
    const float t654 = t625 + t653;
    const float t657 = 1.03154003e+09f * t654;
    const float t658 = t654 * t654;
    const float t659 = 1e-06f - t658;
    const float t660 = root(t659);
    const float t661 = 1000.0f * t660;
    const float t662 = t657 * t661;
    const float t663 = 0.001f + t660;
    const float t664 = t658 / t663;
    const float t665 = t662 * t664;
    const float t666 = (1895.5361f * t654) + t665;
    const float t667 = t567 - t666;
    const float t669 = t654 / t660;
    const float t671 = t657 * (1000.0f * t669);
    const float t672 = (1.03154003e+09f * t661) - t671;
    const float t673 = t664 * t672;
    const float t675 = (2.0f * t654) / t663;
    const float t676 = t664 / t663;
    const float t677 = t676 * t669;
    const float t678 = t675 + t677;
    const float t679 = t662 * t678;
    const float t680 = t673 + t679;
    const float t681 = 1895.5361f + t680;
    const float t682 = t667 / t681;
    const float t683 = t654 + t682;
    const float t686 = 1.03154003e+09f * t683;
    const float t687 = t683 * t683;
    const float t688 = 1e-06f - t687;
    const float t689 = root(t688);
    const float t690 = 1000.0f * t689;
    const float t691 = t686 * t690;
    const float t692 = 0.001f + t689;
    const float t693 = t687 / t692;
    const float t694 = t691 * t693;
    const float t695 = (1895.5361f * t683) + t694;
    const float t696 = t567 - t695;
    const float t698 = t683 / t689;
    const float t700 = t686 * (1000.0f * t698);
    const float t701 = (1.03154003e+09f * t690) - t700;
    const float t702 = t693 * t701;
    const float t704 = (2.0f * t683) / t692;
    const float t705 = t693 / t692;
    const float t706 = t705 * t698;
    const float t707 = t704 + t706;
    const float t708 = t691 * t707;
    const float t709 = t702 + t708;
    const float t710 = 1895.5361f + t709;
    const float t711 = t696 / t710;
    const float t712 = t683 + t711;
    const float t715 = 1.03154003e+09f * t712;
    const float t716 = t712 * t712;
    const float t717 = 1e-06f - t716;
    const float t718 = root(t717);
    const float t719 = 1000.0f * t718;
    const float t720 = t715 * t719;
    const float t721 = 0.001f + t718;
    const float t722 = t716 / t721;
    const float t723 = t720 * t722;
    const float t724 = (1895.5361f * t712) + t723;
    const float t725 = t567 - t724;
    const float t727 = t712 / t718;
    const float t729 = t715 * (1000.0f * t727);
    const float t730 = (1.03154003e+09f * t719) - t729;
    const float t731 = t722 * t730;
    const float t733 = (2.0f * t712) / t721;
    const float t734 = t722 / t721;
    const float t735 = t734 * t727;
    const float t736 = t733 + t735;
    const float t737 = t720 * t736;
    const float t738 = t731 + t737;
    const float t739 = 1895.5361f + t738;
    const float t740 = t725 / t739;
    const float t741 = t712 + t740;
    const float t745 = x[4] - 273.15f;
    const float t747 = 3e-06f + (3e-09f * t745);
    const float t748 = x[4] - 295.15f;
    const float t749 = t747 * t748;
    const float t750 = 177.2821f * t749;
    const float t753 = 1.03154003e+09f * z[4];
    const float t754 = z[4] * z[4];
    const float t755 = 1e-06f - t754;
    const float t756_0 = 0.0004996048f + (500.3872f * t755);
    const float t756 = 0.5f * (t756_0 + (t755 / t756_0));
    const float t757 = 1000.0f * t756;
    const float t758 = t753 * t757;
    const float t759 = 0.001f + t756;
    const float t760 = t754 / t759;
    const float t761 = t758 * t760;
    const float t762 = (1895.5361f * z[4]) + t761;
    const float t763 = t750 - t762;
    const float t765 = z[4] / t756;
    const float t767 = t753 * t765;
    const float t768 = (1.03154003e+09f * t757) - (1000.0f * t767);
    const float t769 = t760 * t768;
    const float t771 = z[4] / t759;
    const float t772 = t760 / t759;
    const float t773 = t772 * t765;
    const float t774 = (2.0f * t771) + t773;
    const float t775 = t758 * t774;
    const float t776 = t769 + t775;
    const float t777 = 1895.5361f + t776;
    const float t778 = t763 / t777;
    const float t779 = z[4] + t778;
    const float t782 = 1.03154003e+09f * t779;
    const float t783 = t779 * t779;
    const float t784 = 1e-06f - t783;
    const float t785_0 = 0.0004894548f + (510.5982f * t784);
    const float t785 = 0.5f * (t785_0 + (t784 / t785_0));
    const float t786 = 1000.0f * t785;
    const float t787 = t782 * t786;
    const float t788 = 0.001f + t785;
    const float t789 = t783 / t788;
    const float t790 = t787 * t789;
    const float t791 = (1895.5361f * t779) + t790;
    const float t792 = t750 - t791;
    const float t794 = t779 / t785;
    const float t796 = t782 * t794;
    const float t797 = (1.03154003e+09f * t786) - (1000.0f * t796);
    const float t798 = t789 * t797;
    const float t800 = t779 / t788;
    const float t801 = t789 / t788;
    const float t802 = t801 * t794;
    const float t803 = (2.0f * t800) + t802;
    const float t804 = t787 * t803;
    const float t805 = t798 + t804;
    const float t806 = 1895.5361f + t805;
    const float t807 = t792 / t806;
    const float t808 = t779 + t807;
    const float t811 = 1.03154003e+09f * t808;
    const float t812 = t808 * t808;
    const float t813 = 1e-06f - t812;
    const float t814 = root(t813);
    const float t815 = 1000.0f * t814;
    const float t816 = t811 * t815;
    const float t817 = 0.001f + t814;
    const float t818 = t812 / t817;
    const float t819 = t816 * t818;
    const float t820 = (1895.5361f * t808) + t819;
    const float t821 = t750 - t820;
    const float t823 = t808 / t814;
    const float t825 = t811 * (1000.0f * t823);
    const float t826 = (1.03154003e+09f * t815) - t825;
    const float t827 = t818 * t826;
    const float t829 = (2.0f * t808) / t817;
    const float t830 = t818 / t817;
    const float t831 = t830 * t823;
    const float t832 = t829 + t831;
    const float t833 = t816 * t832;
    const float t834 = t827 + t833;
    const float t835 = 1895.5361f + t834;
    const float t836 = t821 / t835;
    const float t837 = t808 + t836;
    const float t840 = 1.03154003e+09f * t837;
    const float t841 = t837 * t837;
    const float t842 = 1e-06f - t841;
    const float t843 = root(t842);
    const float t844 = 1000.0f * t843;
    const float t845 = t840 * t844;
    const float t846 = 0.001f + t843;
    const float t847 = t841 / t846;
    const float t848 = t845 * t847;
    const float t849 = (1895.5361f * t837) + t848;
    const float t850 = t750 - t849;
    const float t852 = t837 / t843;
    const float t854 = t840 * (1000.0f * t852);
    const float t855 = (1.03154003e+09f * t844) - t854;
    const float t856 = t847 * t855;
    const float t858 = (2.0f * t837) / t846;
    const float t859 = t847 / t846;
    const float t860 = t859 * t852;
    const float t861 = t858 + t860;
    const float t862 = t845 * t861;
    const float t863 = t856 + t862;
    const float t864 = 1895.5361f + t863;
    const float t865 = t850 / t864;
    const float t866 = t837 + t865;
    const float t869 = 1.03154003e+09f * t866;
    const float t870 = t866 * t866;
    const float t871 = 1e-06f - t870;
    const float t872 = root(t871);
    const float t873 = 1000.0f * t872;
    const float t874 = t869 * t873;
    const float t875 = 0.001f + t872;
    const float t876 = t870 / t875;
    const float t877 = t874 * t876;
    const float t878 = (1895.5361f * t866) + t877;
    const float t879 = t750 - t878;
    const float t881 = t866 / t872;
    const float t883 = t869 * (1000.0f * t881);
    const float t884 = (1.03154003e+09f * t873) - t883;
    const float t885 = t876 * t884;
    const float t887 = (2.0f * t866) / t875;
    const float t888 = t876 / t875;
    const float t889 = t888 * t881;
    const float t890 = t887 + t889;
    const float t891 = t874 * t890;
    const float t892 = t885 + t891;
    const float t893 = 1895.5361f + t892;
    const float t894 = t879 / t893;
    const float t895 = t866 + t894;
    const float t898 = 1.03154003e+09f * t895;
    const float t899 = t895 * t895;
    const float t900 = 1e-06f - t899;
    const float t901 = root(t900);
    const float t902 = 1000.0f * t901;
    const float t903 = t898 * t902;
    const float t904 = 0.001f + t901;
    const float t905 = t899 / t904;
    const float t906 = t903 * t905;
    const float t907 = (1895.5361f * t895) + t906;
    const float t908 = t750 - t907;
    const float t910 = t895 / t901;
    const float t912 = t898 * (1000.0f * t910);
    const float t913 = (1.03154003e+09f * t902) - t912;
    const float t914 = t905 * t913;
    const float t916 = (2.0f * t895) / t904;
    const float t917 = t905 / t904;
    const float t918 = t917 * t910;
    const float t919 = t916 + t918;
    const float t920 = t903 * t919;
    const float t921 = t914 + t920;
    const float t922 = 1895.5361f + t921;
    const float t923 = t908 / t922;
    const float t924 = t895 + t923;
    const float t928 = x[5] - 273.15f;
    const float t930 = 3e-06f + (3e-09f * t928);
    const float t931 = x[5] - 295.15f;
    const float t932 = t930 * t931;
    const float t933 = 177.2821f * t932;
    const float t936 = 1.03154003e+09f * z[5];
    const float t937 = z[5] * z[5];
    const float t938 = 1e-06f - t937;
    const float t939_0 = 0.0004996048f + (500.3872f * t938);
    const float t939 = 0.5f * (t939_0 + (t938 / t939_0));
    const float t940 = 1000.0f * t939;
    const float t941 = t936 * t940;
    const float t942 = 0.001f + t939;
    const float t943 = t937 / t942;
    const float t944 = t941 * t943;
    const float t945 = (1895.5361f * z[5]) + t944;
    const float t946 = t933 - t945;
    const float t948 = z[5] / t939;
    const float t950 = t936 * t948;
    const float t951 = (1.03154003e+09f * t940) - (1000.0f * t950);
    const float t952 = t943 * t951;
    const float t954 = z[5] / t942;
    const float t955 = t943 / t942;
    const float t956 = t955 * t948;
    const float t957 = (2.0f * t954) + t956;
    const float t958 = t941 * t957;
    const float t959 = t952 + t958;
    const float t960 = 1895.5361f + t959;
    const float t961 = t946 / t960;
    const float t962 = z[5] + t961;
    const float t965 = 1.03154003e+09f * t962;
    const float t966 = t962 * t962;
    const float t967 = 1e-06f - t966;
    const float t968_0 = 0.0004894548f + (510.5982f * t967);
    const float t968 = 0.5f * (t968_0 + (t967 / t968_0));
    const float t969 = 1000.0f * t968;
    const float t970 = t965 * t969;
    const float t971 = 0.001f + t968;
    const float t972 = t966 / t971;
    const float t973 = t970 * t972;
    const float t974 = (1895.5361f * t962) + t973;
    const float t975 = t933 - t974;
    const float t977 = t962 / t968;
    const float t979 = t965 * t977;
    const float t980 = (1.03154003e+09f * t969) - (1000.0f * t979);
    const float t981 = t972 * t980;
    const float t983 = t962 / t971;
    const float t984 = t972 / t971;
    const float t985 = t984 * t977;
    const float t986 = (2.0f * t983) + t985;
    const float t987 = t970 * t986;
    const float t988 = t981 + t987;
    const float t989 = 1895.5361f + t988;
    const float t990 = t975 / t989;
    const float t991 = t962 + t990;
    const float t994 = 1.03154003e+09f * t991;
    const float t995 = t991 * t991;
    const float t996 = 1e-06f - t995;
    const float t997 = root(t996);
    const float t998 = 1000.0f * t997;
    const float t999 = t994 * t998;
    const float t1000 = 0.001f + t997;
    const float t1001 = t995 / t1000;
    const float t1002 = t999 * t1001;
    const float t1003 = (1895.5361f * t991) + t1002;
    const float t1004 = t933 - t1003;
    const float t1006 = t991 / t997;
    const float t1008 = t994 * (1000.0f * t1006);
    const float t1009 = (1.03154003e+09f * t998) - t1008;
    const float t1010 = t1001 * t1009;
    const float t1012 = (2.0f * t991) / t1000;
    const float t1013 = t1001 / t1000;
    const float t1014 = t1013 * t1006;
    const float t1015 = t1012 + t1014;
    const float t1016 = t999 * t1015;
    const float t1017 = t1010 + t1016;
    const float t1018 = 1895.5361f + t1017;
    const float t1019 = t1004 / t1018;
    const float t1020 = t991 + t1019;
    const float t1023 = 1.03154003e+09f * t1020;
    const float t1024 = t1020 * t1020;
    const float t1025 = 1e-06f - t1024;
    const float t1026 = root(t1025);
    const float t1027 = 1000.0f * t1026;
    const float t1028 = t1023 * t1027;
    const float t1029 = 0.001f + t1026;
    const float t1030 = t1024 / t1029;
    const float t1031 = t1028 * t1030;
    const float t1032 = (1895.5361f * t1020) + t1031;
    const float t1033 = t933 - t1032;
    const float t1035 = t1020 / t1026;
    const float t1037 = t1023 * (1000.0f * t1035);
    const float t1038 = (1.03154003e+09f * t1027) - t1037;
    const float t1039 = t1030 * t1038;
    const float t1041 = (2.0f * t1020) / t1029;
    const float t1042 = t1030 / t1029;
    const float t1043 = t1042 * t1035;
    const float t1044 = t1041 + t1043;
    const float t1045 = t1028 * t1044;
    const float t1046 = t1039 + t1045;
    const float t1047 = 1895.5361f + t1046;
    const float t1048 = t1033 / t1047;
    const float t1049 = t1020 + t1048;
    const float t1052 = 1.03154003e+09f * t1049;
    const float t1053 = t1049 * t1049;
    const float t1054 = 1e-06f - t1053;
    const float t1055 = root(t1054);
    const float t1056 = 1000.0f * t1055;
    const float t1057 = t1052 * t1056;
    const float t1058 = 0.001f + t1055;
    const float t1059 = t1053 / t1058;
    const float t1060 = t1057 * t1059;
    const float t1061 = (1895.5361f * t1049) + t1060;
    const float t1062 = t933 - t1061;
    const float t1064 = t1049 / t1055;
    const float t1066 = t1052 * (1000.0f * t1064);
    const float t1067 = (1.03154003e+09f * t1056) - t1066;
    const float t1068 = t1059 * t1067;
    const float t1070 = (2.0f * t1049) / t1058;
    const float t1071 = t1059 / t1058;
    const float t1072 = t1071 * t1064;
    const float t1073 = t1070 + t1072;
    const float t1074 = t1057 * t1073;
    const float t1075 = t1068 + t1074;
    const float t1076 = 1895.5361f + t1075;
    const float t1077 = t1062 / t1076;
    const float t1078 = t1049 + t1077;
    const float t1081 = 1.03154003e+09f * t1078;
    const float t1082 = t1078 * t1078;
    const float t1083 = 1e-06f - t1082;
    const float t1084 = root(t1083);
    const float t1085 = 1000.0f * t1084;
    const float t1086 = t1081 * t1085;
    const float t1087 = 0.001f + t1084;
    const float t1088 = t1082 / t1087;
    const float t1089 = t1086 * t1088;
    const float t1090 = (1895.5361f * t1078) + t1089;
    const float t1091 = t933 - t1090;
    const float t1093 = t1078 / t1084;
    const float t1095 = t1081 * (1000.0f * t1093);
    const float t1096 = (1.03154003e+09f * t1085) - t1095;
    const float t1097 = t1088 * t1096;
    const float t1099 = (2.0f * t1078) / t1087;
    const float t1100 = t1088 / t1087;
    const float t1101 = t1100 * t1093;
    const float t1102 = t1099 + t1101;
    const float t1103 = t1086 * t1102;
    const float t1104 = t1097 + t1103;
    const float t1105 = 1895.5361f + t1104;
    const float t1106 = t1091 / t1105;
    const float t1107 = t1078 + t1106;
    result[0] = t192;
    result[1] = t375;
    result[2] = t558;
    result[3] = t741;
    result[4] = t924;
    result[5] = t1107;
}

static void composite_ratio(const float wanted[6], float result[1])
{
    const float t7 = (1.102723e+12f * wanted[1]) - (4.4585724e+12f * wanted[0]);
    const float t11 = t7 + (1.3200545e+11f * wanted[2]);
    const float t15 = t11 + (1.7759255e+12f * wanted[3]);
    const float t19 = t15 - (1.5802731e+12f * wanted[4]);
    const float t23 = t19 - (2.536233e+12f * wanted[5]);
    const float t24 = t23 * t23;
    const float t29 = (1.3734536e+11f * wanted[0]) - (3.5444797e+12f * wanted[1]);
    const float t32 = t29 - (2.7926258e+12f * wanted[2]);
    const float t35 = t32 - (1.9302325e+12f * wanted[3]);
    const float t38 = t35 + (7.0338765e+10f * wanted[4]);
    const float t41 = t38 - (1.9992656e+11f * wanted[5]);
    const float t42 = t41 * t41;
    const float t43 = t24 + t42;
    const float t45 = t43 + 0.3025f;
    const float t46 = root(t45);
    const float t51 = (7.163396e+09f * wanted[0]) - (8.725365e+09f * wanted[1]);
    const float t54 = t51 - (1.0396979e+10f * wanted[2]);
    const float t57 = t54 - (4.441134e+09f * wanted[3]);
    const float t60 = t57 + (2.0934612e+09f * wanted[4]);
    const float t63 = t60 + (8.624482e+09f * wanted[5]);
    const float t64 = (t63 < 0.0f) ? -t63 : t63;
    const float t65 = t46 + t64;
    const float t66 = t65 * t65;
    const float t72 = (1.1599883e+11f * wanted[0]) + (1.5950956e+11f * wanted[1]);
    const float t75 = t72 + (7.835179e+11f * wanted[2]);
    const float t78 = t75 - (1.2846023e+11f * wanted[3]);
    const float t81 = t78 + (2.0036921e+11f * wanted[4]);
    const float t84 = t81 - (5.625638e+11f * wanted[5]);
    const float t85 = t84 * t84;
    const float t86 = 3.0f * t85;
    const float t87 = t66 + t86;
    const float t88 = 3.3057851e-18f * t87;
    const float t93 = (2.3661778e+12f * wanted[0]) + (2.4000602e+12f * wanted[1]);
    const float t96 = t93 + (1.4819732e+12f * wanted[2]);
    const float t99 = t96 - (1.1901199e+12f * wanted[3]);
    const float t102 = t99 - (1.1851115e+12f * wanted[4]);
    const float t105 = t102 + (1.3707138e+12f * wanted[5]);
    const float t106 = t105 * t105;
    const float t111 = (3.50037e+12f * wanted[0]) + (6.7848587e+12f * wanted[1]);
    const float t114 = t111 + (4.059425e+12f * wanted[2]);
    const float t117 = t114 - (1.6124403e+12f * wanted[3]);
    const float t120 = t117 - (3.4923767e+12f * wanted[4]);
    const float t123 = t120 + (2.1020536e+12f * wanted[5]);
    const float t124 = t123 * t123;
    const float t125 = t106 + t124;
    const float t126 = t125 + 0.3025f;
    const float t127 = root(t126);
    const float t128 = t127 + t64;
    const float t129 = t128 * t128;
    const float t130 = t129 + t86;
    const float t131 = 3.3057851e-18f * t130;
    const float t132 = (t88 > t131) ? t88 : t131;
    const float t137 = (1.4880515e+12f * wanted[0]) + (1.02434066e+12f * wanted[1]);
    const float t140 = t137 + (3.1952187e+12f * wanted[2]);
    const float t143 = t140 - (3.3340386e+12f * wanted[3]);
    const float t146 = t143 - (1.4328322e+12f * wanted[4]);
    const float t149 = t146 - (2.6332991e+12f * wanted[5]);
    const float t150 = t149 * t149;
    const float t155 = (2.8585063e+11f * wanted[0]) + (3.333003e+12f * wanted[1]);
    const float t158 = t155 + (3.0894944e+12f * wanted[2]);
    const float t161 = t158 + (1.6695599e+12f * wanted[3]);
    const float t164 = t161 + (2.4708851e+11f * wanted[4]);
    const float t167 = t164 + (7.325468e+10f * wanted[5]);
    const float t168 = t167 * t167;
    const float t169 = t150 + t168;
    const float t170 = t169 + 0.3025f;
    const float t171 = root(t170);
    const float t176 = (1.3912608e+09f * wanted[0]) - (1.1251239e+10f * wanted[1]);
    const float t179 = t176 - (1.1180811e+10f * wanted[2]);
    const float t182 = t179 + (1.8204311e+09f * wanted[3]);
    const float t185 = t182 + (6.4256225e+09f * wanted[4]);
    const float t188 = t185 + (6.1723305e+09f * wanted[5]);
    const float t189 = (t188 < 0.0f) ? -t188 : t188;
    const float t190 = t171 + t189;
    const float t191 = t190 * t190;
    const float t196 = (5.0045413e+11f * wanted[0]) - (6.161432e+11f * wanted[1]);
    const float t199 = t196 - (8.0449085e+10f * wanted[2]);
    const float t202 = t199 - (1.7690893e+11f * wanted[3]);
    const float t205 = t202 + (5.9039056e+11f * wanted[4]);
    const float t208 = t205 + (1.0655088e+11f * wanted[5]);
    const float t209 = t208 * t208;
    const float t210 = 3.0f * t209;
    const float t211 = t191 + t210;
    const float t212 = 3.3057851e-18f * t211;
    const float t213 = (t132 > t212) ? t132 : t212;
    const float t218 = (6.861064e+11f * wanted[1]) - (1.7746715e+12f * wanted[0]);
    const float t221 = t218 + (8.951435e+11f * wanted[2]);
    const float t224 = t221 + (3.2527894e+12f * wanted[3]);
    const float t227 = t224 + (1.7830487e+12f * wanted[4]);
    const float t230 = t227 - (3.4267975e+11f * wanted[5]);
    const float t231 = t230 * t230;
    const float t236 = (3.4239317e+12f * wanted[0]) - (2.704245e+12f * wanted[1]);
    const float t239 = t236 - (4.1205613e+12f * wanted[2]);
    const float t242 = t239 - (6.4245046e+12f * wanted[3]);
    const float t245 = t242 - (3.5701538e+12f * wanted[4]);
    const float t248 = t245 + (1.9693478e+12f * wanted[5]);
    const float t249 = t248 * t248;
    const float t250 = t231 + t249;
    const float t251 = t250 + 0.3025f;
    const float t252 = root(t251);
    const float t253 = t252 + t189;
    const float t254 = t253 * t253;
    const float t255 = t254 + t210;
    const float t256 = 3.3057851e-18f * t255;
    const float t257 = (t213 > t256) ? t213 : t256;
    const float t262 = (1.0806304e+12f * wanted[0]) + (1.4966203e+12f * wanted[1]);
    const float t265 = t262 + (3.0024456e+12f * wanted[2]);
    const float t268 = t265 - (3.4103414e+12f * wanted[3]);
    const float t271 = t268 - (2.2080156e+12f * wanted[4]);
    const float t274 = t271 - (2.6212012e+12f * wanted[5]);
    const float t275 = t274 * t274;
    const float t280 = (1.1551834e+12f * wanted[0]) + (2.0573224e+12f * wanted[1]);
    const float t283 = t280 + (3.2989472e+12f * wanted[2]);
    const float t286 = t283 + (1.4659148e+12f * wanted[3]);
    const float t289 = t286 + (1.7148913e+12f * wanted[4]);
    const float t292 = t289 - (9.493543e+10f * wanted[5]);
    const float t293 = t292 * t292;
    const float t294 = t275 + t293;
    const float t295 = t294 + 0.3025f;
    const float t296 = root(t295);
    const float t301 = (2.0934612e+09f * wanted[0]) + (8.624482e+09f * wanted[1]);
    const float t304 = t301 + (7.163396e+09f * wanted[2]);
    const float t307 = t304 - (8.725365e+09f * wanted[3]);
    const float t310 = t307 - (1.0396979e+10f * wanted[4]);
    const float t313 = t310 - (4.441134e+09f * wanted[5]);
    const float t314 = (t313 < 0.0f) ? -t313 : t313;
    const float t315 = t296 + t314;
    const float t316 = t315 * t315;
    const float t321 = (2.0036921e+11f * wanted[0]) - (5.625638e+11f * wanted[1]);
    const float t324 = t321 + (1.1599883e+11f * wanted[2]);
    const float t327 = t324 + (1.5950956e+11f * wanted[3]);
    const float t330 = t327 + (7.835179e+11f * wanted[4]);
    const float t333 = t330 - (1.2846023e+11f * wanted[5]);
    const float t334 = t333 * t333;
    const float t335 = 3.0f * t334;
    const float t336 = t316 + t335;
    const float t337 = 3.3057851e-18f * t336;
    const float t338 = (t257 > t337) ? t257 : t337;
    const float t343 = (7.064584e+11f * wanted[1]) - (1.883654e+12f * wanted[0]);
    const float t346 = t343 + (1.1220354e+12f * wanted[2]);
    const float t349 = t346 + (3.5960072e+12f * wanted[3]);
    const float t352 = t349 + (2.1216132e+12f * wanted[4]);
    const float t355 = t352 - (4.5177068e+11f * wanted[5]);
    const float t356 = t355 * t355;
    const float t361 = (3.1706516e+12f * wanted[0]) - (2.4079872e+12f * wanted[1]);
    const float t364 = t361 - (4.07338e+12f * wanted[2]);
    const float t367 = t364 - (6.234046e+12f * wanted[3]);
    const float t370 = t367 - (3.7648282e+12f * wanted[4]);
    const float t373 = t370 + (1.952499e+12f * wanted[5]);
    const float t374 = t373 * t373;
    const float t375 = t356 + t374;
    const float t376 = t375 + 0.3025f;
    const float t377 = root(t376);
    const float t378 = t377 + t314;
    const float t379 = t378 * t378;
    const float t380 = t379 + t335;
    const float t381 = 3.3057851e-18f * t380;
    const float t382 = (t338 > t381) ? t338 : t381;
    const float t387 = (9.697803e+11f * wanted[0]) + (1.4594866e+12f * wanted[1]);
    const float t390 = t387 - (5.4737345e+11f * wanted[2]);
    const float t393 = t390 + (2.2814135e+12f * wanted[3]);
    const float t396 = t393 + (9.2301296e+11f * wanted[4]);
    const float t399 = t396 + (3.1843436e+12f * wanted[5]);
    const float t400 = t399 * t399;
    const float t405 = (1.0833221e+12f * wanted[0]) + (2.1930641e+12f * wanted[1]);
    const float t408 = t405 - (1.4129366e+12f * wanted[2]);
    const float t411 = t408 - (2.6369178e+12f * wanted[3]);
    const float t414 = t411 - (4.3476942e+12f * wanted[4]);
    const float t417 = t414 + (1.9398967e+12f * wanted[5]);
    const float t418 = t417 * t417;
    const float t419 = t400 + t418;
    const float t420 = t419 + 0.3025f;
    const float t421 = root(t420);
    const float t426 = (6.4256225e+09f * wanted[0]) + (6.1723305e+09f * wanted[1]);
    const float t429 = t426 + (1.3912608e+09f * wanted[2]);
    const float t432 = t429 - (1.1251239e+10f * wanted[3]);
    const float t435 = t432 - (1.1180811e+10f * wanted[4]);
    const float t438 = t435 + (1.8204311e+09f * wanted[5]);
    const float t439 = (t438 < 0.0f) ? -t438 : t438;
    const float t440 = t421 + t439;
    const float t441 = t440 * t440;
    const float t446 = (5.9039056e+11f * wanted[0]) + (1.0655088e+11f * wanted[1]);
    const float t449 = t446 + (5.0045413e+11f * wanted[2]);
    const float t452 = t449 - (6.161432e+11f * wanted[3]);
    const float t455 = t452 - (8.0449085e+10f * wanted[4]);
    const float t458 = t455 - (1.7690893e+11f * wanted[5]);
    const float t459 = t458 * t458;
    const float t460 = 3.0f * t459;
    const float t461 = t441 + t460;
    const float t462 = 3.3057851e-18f * t461;
    const float t463 = (t382 > t462) ? t382 : t462;
    const float t468 = (1.851032e+12f * wanted[1]) - (3.9721988e+12f * wanted[0]);
    const float t471 = t468 + (3.843818e+12f * wanted[2]);
    const float t474 = t471 - (2.6561623e+12f * wanted[3]);
    const float t477 = t474 - (3.967535e+12f * wanted[4]);
    const float t480 = t477 - (7.1714346e+12f * wanted[5]);
    const float t481 = t480 * t480;
    const float t486 = (3.8327186e+11f * wanted[0]) - (7.5461276e+11f * wanted[1]);
    const float t489 = t486 - (3.1277734e+11f * wanted[2]);
    const float t492 = t489 + (8.53514e+11f * wanted[3]);
    const float t495 = t492 + (1.4279259e+12f * wanted[4]);
    const float t498 = t495 + (6.522469e+11f * wanted[5]);
    const float t499 = t498 * t498;
    const float t500 = t481 + t499;
    const float t501 = t500 + 0.3025f;
    const float t502 = root(t501);
    const float t503 = t502 + t439;
    const float t504 = t503 * t503;
    const float t505 = t504 + t460;
    const float t506 = 3.3057851e-18f * t505;
    const float t507 = (t463 > t506) ? t463 : t506;
    const float t512 = (2.2969296e+12f * wanted[0]) + (6.93611e+11f * wanted[1]);
    const float t515 = t512 + (7.789762e+11f * wanted[2]);
    const float t518 = t515 + (1.5153417e+12f * wanted[3]);
    const float t521 = t518 + (2.2495927e+12f * wanted[4]);
    const float t524 = t521 + (2.4190625e+12f * wanted[5]);
    const float t525 = t524 * t524;
    const float t530 = (1.5938316e+12f * wanted[0]) + (2.529548e+12f * wanted[1]);
    const float t533 = t530 - (1.3767377e+12f * wanted[2]);
    const float t536 = t533 - (2.0435721e+12f * wanted[3]);
    const float t539 = t536 - (3.8518912e+12f * wanted[4]);
    const float t542 = t539 + (2.8155762e+12f * wanted[5]);
    const float t543 = t542 * t542;
    const float t544 = t525 + t543;
    const float t545 = t544 + 0.3025f;
    const float t546 = root(t545);
    const float t551 = ((-1.0396979e+10f) * wanted[0]) - (4.441134e+09f * wanted[1]);
    const float t554 = t551 + (2.0934612e+09f * wanted[2]);
    const float t557 = t554 + (8.624482e+09f * wanted[3]);
    const float t560 = t557 + (7.163396e+09f * wanted[4]);
    const float t563 = t560 - (8.725365e+09f * wanted[5]);
    const float t564 = (t563 < 0.0f) ? -t563 : t563;
    const float t565 = t546 + t564;
    const float t566 = t565 * t565;
    const float t571 = (7.835179e+11f * wanted[0]) - (1.2846023e+11f * wanted[1]);
    const float t574 = t571 + (2.0036921e+11f * wanted[2]);
    const float t577 = t574 - (5.625638e+11f * wanted[3]);
    const float t580 = t577 + (1.1599883e+11f * wanted[4]);
    const float t583 = t580 + (1.5950956e+11f * wanted[5]);
    const float t584 = t583 * t583;
    const float t585 = 3.0f * t584;
    const float t586 = t566 + t585;
    const float t587 = 3.3057851e-18f * t586;
    const float t588 = (t507 > t587) ? t507 : t587;
    const float t593 = (1.9982296e+12f * wanted[1]) - (4.2271263e+12f * wanted[0]);
    const float t596 = t593 + (3.5889726e+12f * wanted[2]);
    const float t599 = t596 - (2.5090518e+12f * wanted[3]);
    const float t602 = t599 - (4.222497e+12f * wanted[4]);
    const float t605 = t602 - (7.0243514e+12f * wanted[5]);
    const float t606 = t605 * t605;
    const float t611 = ((-8.9809656e+11f) * wanted[0]) - (1.5306036e+11f * wanted[1]);
    const float t614 = t611 + (8.487993e+11f * wanted[2]);
    const float t617 = t614 + (4.6308487e+10f * wanted[3]);
    const float t620 = t617 + (1.4800983e+11f * wanted[4]);
    const float t623 = t620 - (1.5662322e+12f * wanted[5]);
    const float t624 = t623 * t623;
    const float t625 = t606 + t624;
    const float t626 = t625 + 0.3025f;
    const float t627 = root(t626);
    const float t628 = t627 + t564;
    const float t629 = t628 * t628;
    const float t630 = t629 + t585;
    const float t631 = 3.3057851e-18f * t630;
    const float t632 = (t588 > t631) ? t588 : t631;
    const float t637 = (8.9836945e+11f * wanted[1]) - (4.4247045e+12f * wanted[0]);
    const float t640 = t637 + (7.435699e+11f * wanted[2]);
    const float t643 = t640 + (1.6559757e+12f * wanted[3]);
    const float t646 = t643 - (1.1844611e+12f * wanted[4]);
    const float t649 = t646 - (3.1986845e+12f * wanted[5]);
    const float t650 = t649 * t649;
    const float t655 = (4.1998467e+11f * wanted[0]) - (3.6188638e+12f * wanted[1]);
    const float t658 = t655 - (1.2494657e+12f * wanted[2]);
    const float t661 = t658 - (2.0487497e+12f * wanted[3]);
    const float t664 = t661 + (9.450183e+11f * wanted[4]);
    const float t667 = t664 - (1.3880204e+12f * wanted[5]);
    const float t668 = t667 * t667;
    const float t669 = t650 + t668;
    const float t670 = t669 + 0.3025f;
    const float t671 = root(t670);
    const float t676 = (1.8204311e+09f * wanted[1]) - (1.1180811e+10f * wanted[0]);
    const float t679 = t676 + (6.4256225e+09f * wanted[2]);
    const float t682 = t679 + (6.1723305e+09f * wanted[3]);
    const float t685 = t682 + (1.3912608e+09f * wanted[4]);
    const float t688 = t685 - (1.1251239e+10f * wanted[5]);
    const float t689 = (t688 < 0.0f) ? -t688 : t688;
    const float t690 = t671 + t689;
    const float t691 = t690 * t690;
    const float t696 = ((-8.0449085e+10f) * wanted[0]) - (1.7690893e+11f * wanted[1]);
    const float t699 = t696 + (5.9039056e+11f * wanted[2]);
    const float t702 = t699 + (1.0655088e+11f * wanted[3]);
    const float t705 = t702 + (5.0045413e+11f * wanted[4]);
    const float t708 = t705 - (6.161432e+11f * wanted[5]);
    const float t709 = t708 * t708;
    const float t710 = 3.0f * t709;
    const float t711 = t691 + t710;
    const float t712 = 3.3057851e-18f * t711;
    const float t713 = (t632 > t712) ? t632 : t712;
    const float t718 = (2.5495121e+12f * wanted[0]) + (2.7678878e+12f * wanted[1]);
    const float t721 = t718 + (1.5541005e+12f * wanted[2]);
    const float t724 = t721 - (1.2738329e+12f * wanted[3]);
    const float t727 = t724 - (1.4484263e+12f * wanted[4]);
    const float t730 = t727 + (1.6090792e+12f * wanted[5]);
    const float t731 = t730 * t730;
    const float t736 = (3.358615e+12f * wanted[0]) + (6.647834e+12f * wanted[1]);
    const float t739 = t736 + (3.6755997e+12f * wanted[2]);
    const float t742 = t739 - (1.5404901e+12f * wanted[3]);
    const float t745 = t742 - (3.5741893e+12f * wanted[4]);
    const float t748 = t745 + (2.279155e+12f * wanted[5]);
    const float t749 = t748 * t748;
    const float t750 = t731 + t749;
    const float t751 = t750 + 0.3025f;
    const float t752 = root(t751);
    const float t753 = t752 + t689;
    const float t754 = t753 * t753;
    const float t755 = t754 + t710;
    const float t756 = 3.3057851e-18f * t755;
    const float t757 = (t713 > t756) ? t713 : t756;
    const float t758 = root(t757);
    result[0] = t758;
}

static void nearest_displacement(const float beyond[6], float result[6])
{
    const float t2 = (beyond[0] > 0.0f) ? beyond[0] : 0.0f;
    const float t4 = (t2 < 5.5e-05f) ? t2 : 5.5e-05f;
    const float t5 = t4 - beyond[0];
    const float t8 = (beyond[1] > 0.0f) ? beyond[1] : 0.0f;
    const float t9 = (t8 < 5.5e-05f) ? t8 : 5.5e-05f;
    const float t10 = t9 - beyond[1];
    const float t12 = t5 + (1.1193434f * t10);
    const float t15 = (beyond[2] > 0.0f) ? beyond[2] : 0.0f;
    const float t16 = (t15 < 5.5e-05f) ? t15 : 5.5e-05f;
    const float t17 = t16 - beyond[2];
    const float t19 = t12 - (0.2363756f * t17);
    const float t22 = (beyond[3] > 0.0f) ? beyond[3] : 0.0f;
    const float t23 = (t22 < 5.5e-05f) ? t22 : 5.5e-05f;
    const float t24 = t23 - beyond[3];
    const float t26 = t19 - (0.16930602f * t24);
    const float t29 = (beyond[4] > 0.0f) ? beyond[4] : 0.0f;
    const float t30 = (t29 < 5.5e-05f) ? t29 : 5.5e-05f;
    const float t31 = t30 - beyond[4];
    const float t33 = t26 - (0.2363756f * t31);
    const float t36 = (beyond[5] > 0.0f) ? beyond[5] : 0.0f;
    const float t37 = (t36 < 5.5e-05f) ? t36 : 5.5e-05f;
    const float t38 = t37 - beyond[5];
    const float t40 = t33 - (0.45906138f * t38);
    const float t41 = t4 - t40;
    const float t42 = (t41 > 0.0f) ? t41 : 0.0f;
    const float t43 = (t42 < 5.5e-05f) ? t42 : 5.5e-05f;
    const float t44 = t43 - t4;
    const float t45 = t40 + t44;
    const float t48 = (0.49971864f * t5) + t10;
    const float t51 = t48 - (0.20494296f * t17);
    const float t54 = t51 - (0.25956145f * t24);
    const float t57 = t54 - (0.07558483f * t31);
    const float t60 = t57 - (0.25956145f * t38);
    const float t62 = t60 + (0.49971864f * t44);
    const float t63 = t9 - t62;
    const float t64 = (t63 > 0.0f) ? t63 : 0.0f;
    const float t65 = (t64 < 5.5e-05f) ? t64 : 5.5e-05f;
    const float t66 = t65 - t9;
    const float t68 = t45 + (1.1193434f * t66);
    const float t73 = ((-0.2363756f) * t5) - (0.45906138f * t10);
    const float t74 = t73 + t17;
    const float t77 = t74 + (1.1193434f * t24);
    const float t80 = t77 - (0.2363756f * t31);
    const float t83 = t80 - (0.16930602f * t38);
    const float t85 = t83 - (0.2363756f * t44);
    const float t87 = t85 - (0.45906138f * t66);
    const float t88 = t16 - t87;
    const float t89 = (t88 > 0.0f) ? t88 : 0.0f;
    const float t90 = (t89 < 5.5e-05f) ? t89 : 5.5e-05f;
    const float t91 = t90 - t16;
    const float t93 = t68 - (0.2363756f * t91);
    const float t98 = ((-0.07558483f) * t5) - (0.25956145f * t10);
    const float t101 = t98 + (0.49971864f * t17);
    const float t102 = t101 + t24;
    const float t105 = t102 - (0.20494296f * t31);
    const float t108 = t105 - (0.25956145f * t38);
    const float t110 = t108 - (0.07558483f * t44);
    const float t112 = t110 - (0.25956145f * t66);
    const float t114 = t112 + (0.49971864f * t91);
    const float t115 = t23 - t114;
    const float t116 = (t115 > 0.0f) ? t115 : 0.0f;
    const float t117 = (t116 < 5.5e-05f) ? t116 : 5.5e-05f;
    const float t118 = t117 - t23;
    const float t120 = t93 - (0.16930602f * t118);
    const float t125 = ((-0.2363756f) * t5) - (0.16930602f * t10);
    const float t128 = t125 - (0.2363756f * t17);
    const float t131 = t128 - (0.45906138f * t24);
    const float t132 = t131 + t31;
    const float t135 = t132 + (1.1193434f * t38);
    const float t137 = t135 - (0.2363756f * t44);
    const float t139 = t137 - (0.16930602f * t66);
    const float t141 = t139 - (0.2363756f * t91);
    const float t143 = t141 - (0.45906138f * t118);
    const float t144 = t30 - t143;
    const float t145 = (t144 > 0.0f) ? t144 : 0.0f;
    const float t146 = (t145 < 5.5e-05f) ? t145 : 5.5e-05f;
    const float t147 = t146 - t30;
    const float t149 = t120 - (0.2363756f * t147);
    const float t154 = ((-0.20494296f) * t5) - (0.25956145f * t10);
    const float t157 = t154 - (0.07558483f * t17);
    const float t160 = t157 - (0.25956145f * t24);
    const float t163 = t160 + (0.49971864f * t31);
    const float t164 = t163 + t38;
    const float t166 = t164 - (0.20494296f * t44);
    const float t168 = t166 - (0.25956145f * t66);
    const float t170 = t168 - (0.07558483f * t91);
    const float t172 = t170 - (0.25956145f * t118);
    const float t174 = t172 + (0.49971864f * t147);
    const float t175 = t37 - t174;
    const float t176 = (t175 > 0.0f) ? t175 : 0.0f;
    const float t177 = (t176 < 5.5e-05f) ? t176 : 5.5e-05f;
    const float t178 = t177 - t37;
    const float t180 = t149 - (0.45906138f * t178);
    const float t181 = t43 - t180;
    const float t182 = (t181 > 0.0f) ? t181 : 0.0f;
    const float t183 = (t182 < 5.5e-05f) ? t182 : 5.5e-05f;
    const float t184 = t183 - t43;
    const float t185 = t180 + t184;
    const float t186 = t62 + t66;
    const float t188 = t186 - (0.20494296f * t91);
    const float t190 = t188 - (0.25956145f * t118);
    const float t192 = t190 - (0.07558483f * t147);
    const float t194 = t192 - (0.25956145f * t178);
    const float t196 = t194 + (0.49971864f * t184);
    const float t197 = t65 - t196;
    const float t198 = (t197 > 0.0f) ? t197 : 0.0f;
    const float t199 = (t198 < 5.5e-05f) ? t198 : 5.5e-05f;
    const float t200 = t199 - t65;
    const float t202 = t185 + (1.1193434f * t200);
    const float t203 = t87 + t91;
    const float t205 = t203 + (1.1193434f * t118);
    const float t207 = t205 - (0.2363756f * t147);
    const float t209 = t207 - (0.16930602f * t178);
    const float t211 = t209 - (0.2363756f * t184);
    const float t213 = t211 - (0.45906138f * t200);
    const float t214 = t90 - t213;
    const float t215 = (t214 > 0.0f) ? t214 : 0.0f;
    const float t216 = (t215 < 5.5e-05f) ? t215 : 5.5e-05f;
    const float t217 = t216 - t90;
    const float t219 = t202 - (0.2363756f * t217);
    const float t220 = t114 + t118;
    const float t222 = t220 - (0.20494296f * t147);
    const float t224 = t222 - (0.25956145f * t178);
    const float t226 = t224 - (0.07558483f * t184);
    const float t228 = t226 - (0.25956145f * t200);
    const float t230 = t228 + (0.49971864f * t217);
    const float t231 = t117 - t230;
    const float t232 = (t231 > 0.0f) ? t231 : 0.0f;
    const float t233 = (t232 < 5.5e-05f) ? t232 : 5.5e-05f;
    const float t234 = t233 - t117;
    const float t236 = t219 - (0.16930602f * t234);
    const float t237 = t143 + t147;
    const float t239 = t237 + (1.1193434f * t178);
    const float t241 = t239 - (0.2363756f * t184);
    const float t243 = t241 - (0.16930602f * t200);
    const float t245 = t243 - (0.2363756f * t217);
    const float t247 = t245 - (0.45906138f * t234);
    const float t248 = t146 - t247;
    const float t249 = (t248 > 0.0f) ? t248 : 0.0f;
    const float t250 = (t249 < 5.5e-05f) ? t249 : 5.5e-05f;
    const float t251 = t250 - t146;
    const float t253 = t236 - (0.2363756f * t251);
    const float t254 = t174 + t178;
    const float t256 = t254 - (0.20494296f * t184);
    const float t258 = t256 - (0.25956145f * t200);
    const float t260 = t258 - (0.07558483f * t217);
    const float t262 = t260 - (0.25956145f * t234);
    const float t264 = t262 + (0.49971864f * t251);
    const float t265 = t177 - t264;
    const float t266 = (t265 > 0.0f) ? t265 : 0.0f;
    const float t267 = (t266 < 5.5e-05f) ? t266 : 5.5e-05f;
    const float t268 = t267 - t177;
    const float t270 = t253 - (0.45906138f * t268);
    const float t271 = t183 - t270;
    const float t272 = (t271 > 0.0f) ? t271 : 0.0f;
    const float t273 = (t272 < 5.5e-05f) ? t272 : 5.5e-05f;
    const float t275 = t196 + t200;
    const float t277 = t275 - (0.20494296f * t217);
    const float t279 = t277 - (0.25956145f * t234);
    const float t281 = t279 - (0.07558483f * t251);
    const float t283 = t281 - (0.25956145f * t268);
    const float t284 = t273 - t183;
    const float t286 = t283 + (0.49971864f * t284);
    const float t287 = t199 - t286;
    const float t288 = (t287 > 0.0f) ? t287 : 0.0f;
    const float t289 = (t288 < 5.5e-05f) ? t288 : 5.5e-05f;
    const float t291 = t213 + t217;
    const float t293 = t291 + (1.1193434f * t234);
    const float t295 = t293 - (0.2363756f * t251);
    const float t297 = t295 - (0.16930602f * t268);
    const float t299 = t297 - (0.2363756f * t284);
    const float t300 = t289 - t199;
    const float t302 = t299 - (0.45906138f * t300);
    const float t303 = t216 - t302;
    const float t304 = (t303 > 0.0f) ? t303 : 0.0f;
    const float t305 = (t304 < 5.5e-05f) ? t304 : 5.5e-05f;
    const float t307 = t230 + t234;
    const float t309 = t307 - (0.20494296f * t251);
    const float t311 = t309 - (0.25956145f * t268);
    const float t313 = t311 - (0.07558483f * t284);
    const float t315 = t313 - (0.25956145f * t300);
    const float t316 = t305 - t216;
    const float t318 = t315 + (0.49971864f * t316);
    const float t319 = t233 - t318;
    const float t320 = (t319 > 0.0f) ? t319 : 0.0f;
    const float t321 = (t320 < 5.5e-05f) ? t320 : 5.5e-05f;
    const float t323 = t247 + t251;
    const float t325 = t323 + (1.1193434f * t268);
    const float t327 = t325 - (0.2363756f * t284);
    const float t329 = t327 - (0.16930602f * t300);
    const float t331 = t329 - (0.2363756f * t316);
    const float t332 = t321 - t233;
    const float t334 = t331 - (0.45906138f * t332);
    const float t335 = t250 - t334;
    const float t336 = (t335 > 0.0f) ? t335 : 0.0f;
    const float t337 = (t336 < 5.5e-05f) ? t336 : 5.5e-05f;
    const float t339 = t264 + t268;
    const float t341 = t339 - (0.20494296f * t284);
    const float t343 = t341 - (0.25956145f * t300);
    const float t345 = t343 - (0.07558483f * t316);
    const float t347 = t345 - (0.25956145f * t332);
    const float t348 = t337 - t250;
    const float t350 = t347 + (0.49971864f * t348);
    const float t351 = t267 - t350;
    const float t352 = (t351 > 0.0f) ? t351 : 0.0f;
    const float t353 = (t352 < 5.5e-05f) ? t352 : 5.5e-05f;
    result[0] = t273;
    result[1] = t289;
    result[2] = t305;
    result[3] = t321;
    result[4] = t337;
    result[5] = t353;
}

static void composite_bound(const float wanted[6], float result[1])
{
    const float t6 = ((-7418.532f) * wanted[0]) - (4198.844f * wanted[1]);
    const float t10 = t6 + (72.96058f * wanted[2]);
    const float t14 = t10 + (8524.06f * wanted[3]);
    const float t18 = t14 + (7345.572f * wanted[4]);
    const float t22 = t18 - (4325.2153f * wanted[5]);
    const float t23 = (t22 < 0.0f) ? -t22 : t22;
    const float t28 = (8359.642f * wanted[1]) - (4731.5063f * wanted[0]);
    const float t31 = t28 + (9605.415f * wanted[2]);
    const float t34 = t31 - (82.2163f * wanted[3]);
    const float t37 = t34 - (4873.909f * wanted[4]);
    const float t40 = t37 - (8277.426f * wanted[5]);
    const float t41 = (t40 < 0.0f) ? -t40 : t40;
    const float t42 = t23 + t41;
    const float t47 = (3009.9507f * wanted[0]) - (1737.9247f * wanted[1]);
    const float t50 = t47 + (3009.9507f * wanted[2]);
    const float t53 = t50 - (1737.9247f * wanted[3]);
    const float t56 = t53 + (3009.9507f * wanted[4]);
    const float t59 = t56 - (1737.9247f * wanted[5]);
    const float t60 = (t59 < 0.0f) ? -t59 : t59;
    const float t61 = t42 + t60;
    const float t66 = (2774.401f * wanted[0]) + (4745.9053f * wanted[1]);
    const float t69 = t66 + (2774.401f * wanted[2]);
    const float t72 = t69 + (4745.9053f * wanted[3]);
    const float t75 = t72 + (2774.401f * wanted[4]);
    const float t78 = t75 + (4745.9053f * wanted[5]);
    const float t79 = (t78 < 0.0f) ? -t78 : t78;
    const float t80 = t61 + t79;
    const float t82 = t80 + 2.0006166e-09f;
    const float t84 = t82 + 1e-06f;
    result[0] = t84;
}

/* 1 if every displacement is inside its limits: distance from the middle squared, no more than the half width squared. 0 for NaN. */
static int displacement_inside(const float value[6])
{
    const float d0 = value[0] - 2.75e-05f;
    const float d1 = value[1] - 2.75e-05f;
    const float d2 = value[2] - 2.75e-05f;
    const float d3 = value[3] - 2.75e-05f;
    const float d4 = value[4] - 2.75e-05f;
    const float d5 = value[5] - 2.75e-05f;
    return (((d0 * d0) <= 7.5624856e-10f) && ((d1 * d1) <= 7.5624856e-10f) && ((d2 * d2) <= 7.5624856e-10f) && ((d3 * d3) <= 7.5624856e-10f) && ((d4 * d4) <= 7.5624856e-10f) && ((d5 * d5) <= 7.5624856e-10f)) ? 1 : 0;
}

/* 1 if every heater power is inside its limits: distance from the middle squared, no more than the half width squared. 0 for NaN. */
static int drive_inside(const float value[6])
{
    const float d0 = value[0] - 0.5f;
    const float d1 = value[1] - 0.5f;
    const float d2 = value[2] - 0.5f;
    const float d3 = value[3] - 0.5f;
    const float d4 = value[4] - 0.5f;
    const float d5 = value[5] - 0.5f;
    return (((d0 * d0) <= 0.24999952f) && ((d1 * d1) <= 0.24999952f) && ((d2 * d2) <= 0.24999952f) && ((d3 * d3) <= 0.24999952f) && ((d4 * d4) <= 0.24999952f) && ((d5 * d5) <= 0.24999952f)) ? 1 : 0;
}

/* Clips value to low ... high; 1 if a component changed by more than its slack or was NaN. */
static int limit_all(float value[6], const float low[6], const float high[6], const float slack[6])
{
    int hit = 0;
    int i;
    for (i = 0; i < 6; i++) {
        const float wanted = value[i];
        const float raised = (wanted > low[i]) ? wanted : low[i];
        const float limited = (raised < high[i]) ? raised : high[i];
        const float moved = limited - wanted;
        if (!((moved <= slack[i]) && (moved >= -slack[i]))) {
            hit = 1;
        }
        value[i] = limited;
    }
    return hit;
}

/* Clips a displacement to its range; 1 if it was beyond by more than the slack. */
static int limit_displacement(float value[6])
{
    static const float LOW[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f }; /* m */
    static const float HIGH[6] = { 5.5e-05f, 5.5e-05f, 5.5e-05f, 5.5e-05f, 5.5e-05f, 5.5e-05f }; /* m */
    static const float SLACK[6] = { 4e-11f, 4e-11f, 4e-11f, 4e-11f, 4e-11f, 4e-11f }; /* m */
    return limit_all(value, LOW, HIGH, SLACK);
}

/* 1 if every drive is within its limits or beyond by no more than the slack. */
static int drives_admissible(const float drive[6])
{
    int admissible = 1;
    int i;
    for (i = 0; i < 6; i++) {
        if (!((drive[i] <= (U_HIGH[i] + U_SLACK[i])) && (drive[i] >= (U_LOW[i] - U_SLACK[i])))) {
            admissible = 0;
        }
    }
    return admissible;
}

/* 1 if every component is a number of a plausible size. */
static int is_usable(const float target[6])
{
    static const float TARGET_LIMIT[6] = { 63.61323f, 63.61323f, 63.61323f, 0.1f, 0.1f, 0.1f }; /* SI */
    int usable = 1;
    int i;
    for (i = 0; i < 6; i++) {
        if (!((target[i] <= TARGET_LIMIT[i]) && (target[i] >= -TARGET_LIMIT[i]))) {
            usable = 0;
        }
    }
    return usable;
}
/* Scales a displacement that breaks wire flexure stress toward home: 0 untouched, 1 scaled, 2 scaled by more than the slack. */
static int limit_composite(const mems_hexapod_online_f32_state *state, float wanted[6])
{
    int hit = 0;
    float bound[1];
    composite_bound(wanted, bound);
    if (!(bound[0] <= 1.0f)) {
        float worst[1];
        composite_ratio(wanted, worst);
        if (worst[0] > 1.0f) {
            int i;
            if (worst[0] > 1.000004f) {
                hit = 2;
            } else {
                hit = 1;
            }
            for (i = 0; i < 6; i++) {
                wanted[i] = wanted[i] / worst[0];
            }
        }
    }
    (void)state;
    return hit;
}
/* Actuator state (limited) and drives (not limited) that out->displacement needs. */
static void step_drives(const mems_hexapod_online_f32_state *state, mems_hexapod_online_f32_output *out)
{
    wanted_state(out->displacement, out->state);
    step_drive(state->x, out->state, out->drive);
}

/* Line search from origin toward out->displacement, whose drives are inadmissible: 3 secants of the drive that is first
 * at its limit. Leaves the farthest admissible displacement found and its drives; 1 if even those of origin are inadmissible. */
static int step_line_search(const mems_hexapod_online_f32_state *state, const float origin[6], mems_hexapod_online_f32_output *out)
{
    float direction[6];
    float at_target[6];
    int i;
    for (i = 0; i < 6; i++) {
        direction[i] = out->displacement[i] - origin[i];
        at_target[i] = out->drive[i];
        out->displacement[i] = origin[i];
    }
    step_drives(state, out);
    if (drives_admissible(out->drive) != 0) {
        float at_start[6];
        float state_at_start[6];
        float accepted = 0.0f;
        float rejected = 1.0f;
        int trial;
        for (i = 0; i < 6; i++) {
            at_start[i] = out->drive[i];
        }
        for (i = 0; i < 6; i++) {
            state_at_start[i] = out->state[i];
        }
        for (trial = 0; trial < 3; trial++) {
            float share = 1.0f;
            float fraction;
            for (i = 0; i < 6; i++) {
                if ((at_target[i] > (U_HIGH[i] + U_SLACK[i])) || (at_target[i] < (U_LOW[i] - U_SLACK[i]))) {
                    const float limit = (at_target[i] > U_HIGH[i]) ? U_HIGH[i] : U_LOW[i];
                    const float reached = (limit - at_start[i]) / (at_target[i] - at_start[i]);
                    share = (reached < share) ? reached : share;
                }
            }
            share = (share > 0.0f) ? share : 0.0f;
            fraction = accepted + ((0.99609375f * share) * (rejected - accepted));
            for (i = 0; i < 6; i++) {
                out->displacement[i] = origin[i] + (fraction * direction[i]);
            }
            step_drives(state, out);
            if (drives_admissible(out->drive) != 0) {
                accepted = fraction;
                for (i = 0; i < 6; i++) {
                    at_start[i] = out->drive[i];
                }
                for (i = 0; i < 6; i++) {
                    state_at_start[i] = out->state[i];
                }
            } else {
                rejected = fraction;
                for (i = 0; i < 6; i++) {
                    at_target[i] = out->drive[i];
                }
            }
        }
        for (i = 0; i < 6; i++) {
            out->displacement[i] = origin[i] + (accepted * direction[i]);
            out->drive[i] = at_start[i];
        }
        for (i = 0; i < 6; i++) {
            out->state[i] = state_at_start[i];
        }
    }
    return limit_all(out->drive, U_LOW, U_HIGH, U_SLACK);
}
void mems_hexapod_online_f32_init(mems_hexapod_online_f32_state *state)
{
    if (state != NULL) {
        int i;
        for (i = 0; i < 6; i++) {
            state->x[i] = X_REST[i];
        }
        for (i = 0; i < 6; i++) {
            state->z[i] = 0.0f;
        }
        state->ready = READY;
    }
}

/* 1 if a number of the state is NaN, infinite or far beyond its range. Asked first where displacements depend on the state or effects
 * remember, else where a limit is met: until then it would show in the drives, or is written anew. Numbers with one range are judged by the sum of their squares, at most their count
 * times (4 times the largest magnitude of the range) squared. */
static int is_lost(const mems_hexapod_online_f32_state *state)
{
    const float squares0 = (((((state->x[0] * state->x[0]) + (state->x[1] * state->x[1])) + (state->x[2] * state->x[2])) + (state->x[3] * state->x[3])) + (state->x[4] * state->x[4])) + (state->x[5] * state->x[5]);
    const float squares1 = (((((state->z[0] * state->z[0]) + (state->z[1] * state->z[1])) + (state->z[2] * state->z[2])) + (state->z[3] * state->z[3])) + (state->z[4] * state->z[4])) + (state->z[5] * state->z[5]);
    return ((squares0 <= 6.504729e+07f) && (squares1 <= 2.904e-07f)) ? 0 : 1;
}

/* The answer to a lost state: the safe drive, under which the device comes to rest. The state stays lost until it is initialised. */
static uint32_t set_lost(mems_hexapod_online_f32_state *state, mems_hexapod_online_f32_output *out)
{
    int i;
    state->ready = 0U;
    for (i = 0; i < 6; i++) {
        out->drive[i] = U_SAFE[i];
        out->displacement[i] = 0.0f;
    }
    for (i = 0; i < 6; i++) {
        out->state[i] = X_REST[i];
    }
    return MEMS_HEXAPOD_ONLINE_F32_LOST;
}
/* Without a usable target: the safe drive, and the state it leads to. */
static void settle_safe(mems_hexapod_online_f32_state *state, mems_hexapod_online_f32_output *out)
{
    int i;
    for (i = 0; i < 6; i++) {
        out->drive[i] = U_SAFE[i];
        out->displacement[i] = state->z[i];
        out->state[i] = state->x[i];
    }
    wanted_advance(out->drive, state->x);
    balance_displacement(state->x, out->displacement, state->z);
}

/* Drives for out->displacement with every limit kept; advances the state to the next sample. */
static uint32_t settle_within(mems_hexapod_online_f32_state *state, mems_hexapod_online_f32_output *out)
{
    uint32_t status = 0U;
    int lost = 0;
    wanted_state(out->displacement, out->state);
    {
        const int scaled = limit_composite(state, out->displacement);
        if (scaled > 0) {
            if (scaled > 1) {
                status |= MEMS_HEXAPOD_ONLINE_F32_COMPOSITE;
            }
            wanted_state(out->displacement, out->state);
        }
    }
    wanted_drive(out->state, out->drive);
    if (drive_inside(out->drive) == 0) {
        if (is_lost(state) != 0) {
            status = set_lost(state, out);
            lost = 1;
        } else {
            (void)limit_all(out->drive, U_LOW, U_HIGH, U_SLACK); /* no displacement in range needs more than rounding beyond */
        }
    }
    if (lost == 0) {
        state->x[0] = out->state[0];
        state->x[1] = out->state[1];
        state->x[2] = out->state[2];
        state->x[3] = out->state[3];
        state->x[4] = out->state[4];
        state->x[5] = out->state[5];
        state->z[0] = out->displacement[0];
        state->z[1] = out->displacement[1];
        state->z[2] = out->displacement[2];
        state->z[3] = out->displacement[3];
        state->z[4] = out->displacement[4];
        state->z[5] = out->displacement[5];
    }
    return status;
}

uint32_t mems_hexapod_online_f32_settle(mems_hexapod_online_f32_state *state, const float target[6], mems_hexapod_online_f32_output *out)
{
    uint32_t status = MEMS_HEXAPOD_ONLINE_F32_INPUT;
    if ((state == NULL) || (target == NULL) || (out == NULL)) {
        /* nothing is written */
    } else if (state->ready != READY) {
        status = set_lost(state, out);
    } else {
        wanted_displacement(target, out->displacement);
        if (displacement_inside(out->displacement) != 0) {
            status = settle_within(state, out);
        } else if (is_usable(target) != 0) {
            float beyond[6];
            int hit;
            int i;
            for (i = 0; i < 6; i++) {
                beyond[i] = out->displacement[i];
            }
            hit = limit_displacement(out->displacement);
            if (hit != 0) {
                nearest_displacement(beyond, out->displacement);
            }
            status = settle_within(state, out);
            if ((hit != 0) && (status != MEMS_HEXAPOD_ONLINE_F32_LOST)) {
                status |= MEMS_HEXAPOD_ONLINE_F32_DISPLACEMENT;
            }
        } else if (is_lost(state) != 0) {
            status = set_lost(state, out);
        } else {
            settle_safe(state, out);
        }
    }
    return status;
}
/* Without a usable target: the safe drive, and the state it leads to. */
static void step_safe(mems_hexapod_online_f32_state *state, mems_hexapod_online_f32_output *out)
{
    int i;
    for (i = 0; i < 6; i++) {
        out->drive[i] = U_SAFE[i];
        out->displacement[i] = state->z[i];
        out->state[i] = state->x[i];
    }
    step_advance(state->x, out->drive, state->x);
    balance_displacement(state->x, out->displacement, state->z);
}

/* Drives for out->displacement with every limit kept; advances the state to the next sample. */
static uint32_t step_within(mems_hexapod_online_f32_state *state, mems_hexapod_online_f32_output *out)
{
    uint32_t status = 0U;
    int limited = 0;
    int lost = 0;
    wanted_state(out->displacement, out->state);
    {
        const int scaled = limit_composite(state, out->displacement);
        if (scaled > 0) {
            if (scaled > 1) {
                status |= MEMS_HEXAPOD_ONLINE_F32_COMPOSITE;
            }
            wanted_state(out->displacement, out->state);
        }
    }
    step_drive(state->x, out->state, out->drive);
    if (drive_inside(out->drive) == 0) {
        if (is_lost(state) != 0) {
            status = set_lost(state, out);
            lost = 1;
        } else if (drives_admissible(out->drive) != 0) {
            (void)limit_all(out->drive, U_LOW, U_HIGH, U_SLACK);
        } else {
            limited = step_line_search(state, state->z, out);
            status |= MEMS_HEXAPOD_ONLINE_F32_DRIVE;
        }
    }
    if (lost == 0) {
        if (limited != 0) {
            step_advance(state->x, out->drive, state->x);
            balance_displacement(state->x, out->displacement, out->displacement);
        } else { /* the drive was computed for these; one by one, because a loop costs a small core twice as much */
            state->x[0] = out->state[0];
            state->x[1] = out->state[1];
            state->x[2] = out->state[2];
            state->x[3] = out->state[3];
            state->x[4] = out->state[4];
            state->x[5] = out->state[5];
        }
        state->z[0] = out->displacement[0];
        state->z[1] = out->displacement[1];
        state->z[2] = out->displacement[2];
        state->z[3] = out->displacement[3];
        state->z[4] = out->displacement[4];
        state->z[5] = out->displacement[5];
    }
    return status;
}

uint32_t mems_hexapod_online_f32_step(mems_hexapod_online_f32_state *state, const float target[6], mems_hexapod_online_f32_output *out)
{
    uint32_t status = MEMS_HEXAPOD_ONLINE_F32_INPUT;
    if ((state == NULL) || (target == NULL) || (out == NULL)) {
        /* nothing is written */
    } else if (state->ready != READY) {
        status = set_lost(state, out);
    } else {
        wanted_displacement(target, out->displacement);
        if (displacement_inside(out->displacement) != 0) {
            status = step_within(state, out);
        } else if (is_usable(target) != 0) {
            float beyond[6];
            int hit;
            int i;
            for (i = 0; i < 6; i++) {
                beyond[i] = out->displacement[i];
            }
            hit = limit_displacement(out->displacement);
            if (hit != 0) {
                nearest_displacement(beyond, out->displacement);
            }
            status = step_within(state, out);
            if ((hit != 0) && (status != MEMS_HEXAPOD_ONLINE_F32_LOST)) {
                status |= MEMS_HEXAPOD_ONLINE_F32_DISPLACEMENT;
            }
        } else if (is_lost(state) != 0) {
            status = set_lost(state, out);
        } else {
            step_safe(state, out);
        }
    }
    return status;
}

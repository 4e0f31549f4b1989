# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheen of microfibres: light scattered many times in a layer of fibres, as a cosine lobe bent.

Zeltner, Burley and Chiang, Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines
(2022): a direction c of density cosθ_c/π becomes ω_i ∥ (c_x − b c_z, c_y, a c_z), x being towards
the viewer. For ω_i = (x, y, z) then c ∥ v = (a x + b z, a y, z) and dω_c/dω_i = a²/|v|³:

    density of ω_i   z/π (a/|v|²)²,     f cosθ_i   R times that

R, a and b of roughness and cosθ_o are the authors' fit to a simulation, which Cycles looks up in
tables (Apache-2.0), linearly between 32 × 32 nodes. Here they are as measured: sharp suns on white
Sheen give f cosθ_i, and √(z/(π f cosθ_i)) = |v|²/(a √R) is linear in (a², 2 a b, b² + 1)/(a √R).
"""

from __future__ import annotations

import zlib
from base64 import b85decode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ._base import Array, Frame, Lobe, dot
from ._diffuse import cosine_weighted
from ._energy import looked_up

NODES = 32


@lru_cache(maxsize=1)
def tables() -> Array:
    """Return R, a and −b at the nodes of roughness and cosθ_o, (3, 32, 32)."""
    low, high = np.frombuffer(zlib.decompress(b85decode(_MEASURED)), np.uint8).reshape(2, -1)
    steps = (low + 256 * high.astype(np.int64)).reshape(3, NODES, NODES)
    return np.cumsum(steps, axis=1) % 65536 / 65535.0


@dataclass(frozen=True)
class Sheen(Lobe):
    """The lobe of the fibres.

    Attributes
    ----------
    weight : (n, 3).
    frame : z along the normal, x towards the viewer.
    reflectance, a, b : (n,) R and the bend of the cosine.
    """

    ray = "diffuse"
    reciprocal = False  # the fit is seen from ω_o alone
    weight: Array
    frame: Frame
    reflectance: Array
    a: Array
    b: Array

    @classmethod
    def of(cls, weight: Array, normal: Array, wo: Array, roughness: Array) -> Sheen:
        """Return the lobe of points with unit normals (n, 3) and a roughness (n,) in [0, 1]."""
        at = np.clip(roughness, 1e-3, 1.0), dot(normal, wo)
        found, a, b = (looked_up(table, *at) for table in tables())
        return cls(weight, Frame.around(normal, wo), np.where(a < 1e-5, 0.0, found), a, -b)

    def evaluate(self, wi: Array) -> tuple[Array, Array]:
        x, y, z = self.frame.local(wi).T
        square = (self.a * x + self.b * z) ** 2 + (self.a * y) ** 2 + z * z
        value = np.maximum(z, 0.0) / np.pi * (self.a / np.maximum(square, 1e-30)) ** 2
        return (self.reflectance * value)[:, None], value

    def sample(self, u: Array) -> Array:
        found = cosine_weighted(u)
        found[:, 0] -= self.b * found[:, 2]
        found[:, 2] *= self.a
        return self.frame.world(found / np.sqrt(dot(found, found))[:, None])

    def albedo(self) -> Array:
        return self.reflectance[:, None]

    @classmethod
    def examples(cls, wo: Array, frame: Frame) -> Sequence[Sheen]:
        n = len(wo)
        return [cls.of(np.ones((n, 3)), frame.z, wo, np.full(n, r)) for r in (0.3, 0.9)]


_MEASURED = (
    "c-n=R2{=@36vt<~Gh>+{OSVc#ma>%WOChPO*-~UHvM(V;QAndiv>++6lwGo=R20=`O(FaDDJ9vGeVO_0Y|LcoJUq`l^Z%X"
    "yedoRJIp<zK$l4Jg1+1z2HI>=%q7kswbnT-@(9T6_8(0`n2>1%rfzq<+!~k`?kBZ=W3?l;)K)~s+_(_k%pBcwd0z0x!?h)"
    "O@!2&W!BtXJI4(eCY*l2e<AEu<wrr&<!gqD;rA15o835^07I7of8>`N%ZSoCT9QXF9MfEI<?9h4W_%*V-wVParFp@4?M0)"
    "Lroks?O4anHlYGiQ04?+4oIsO;FfnU`xFD~3tpQar3?92x6r^wCE^RR1nKQf{a$#>Yx;_bzdvjoch#A+BEIqaDqbS?SmPZ"
    "7)1w_L{n*&)Sv~;bW<%E+-+@Fvh>p{Hu0tv)yOT<F3(paH|fp$#{#6Bd?P~+>aV+<XXOAITvQ%vaUBrJf2xEchumKc$)rT"
    "lC2b^x!`u7+iRynr+6c=64&z{5($!bHeH(ZAM#vypfQkfN)h|z-GiZ-i;2(Q7pd7z^fu(^P1`dj2xN%o?(T`x8Y>Do$TeD"
    "o6ty%}%)b0qL_gR;n>9;$K8UBxsxMl&?ve(fBHDQH6*s2#{+XWircL}<C_{TRTUXq!wou+CSJBo8y~#=lw!izu{vppy*;A"
    "E_zf)_9uB-HfD-WdUapbx2)!f*>x8Xy;t{OW`+$UM<P+ZczNPQjtfd?lxv<2^($oH4*b)3!C{_#vDRw#BrTqiQv)7`;PVy"
    "-^XM)+5Q@6PELfrr1R`_CJX`7j^6Q_d)=YhfE=XSpBS|0?A8`mtvr25iyl<+}BD13EW;SVcFpsvJ>0qPAB_n2)vl{VhNF$"
    "=5mAyF1kD6+<`=^=)*`C>!4(xKT+((?AikZsb!@YM8;+A+0yMU78o#b#QrV(huIY$P3HJDIYg5(Uj(&pZWA5aoGK<Lim(#"
    "@h^kCN_myA_;*NgAuSO@14~KOeNvK}xc1|i^&^LLF1B`<<xQ#`xRP4hk6tgXq;F<#wBO|9AxFiiPm+;!qSn>?{93;65lSX"
    "kQ+pX?^{wpBB*Z_8%FVj)ncw}+hdGz%*9(?W&quj*9g}jp#wKK}Zbg?Am6o^oJ{HsuecI1wlsPpnj(hV9udROhVciHpNXa"
    "WcrLnFx<t=t^z}+v~ZQNqUMYo!Ue_`5T?EKF+th|!BV|LvbDmZ_B5AJqa#jJC7PW$=;-l<h=;?ABamA?&rV}gpCXOr3&l&"
    "$jHdzc||VU-`?`hNL8H_0mCo|f1CR*Vct@67y5{p<VIt*KAh_aaiA93QWyPrmm!UF6oTfKhILpm1opo_;MH_qBfy(B54ep"
    "fF;_AyO<2F`?~0&KQ${ZL-4)t?+{S<6<vPjUt5-pi`W40{rP<{qy?^)!gNR`=0iCrW|sU(^FXb#ZHkB+#WS%+@;JBOP1e>"
    "DyPOB-1R!8;d3`Hd>4{@smJc|s<R`i!uC+mK_AtHkrX$#i-&rRUyZUWKuh;)ixkT+PXzB2^G<L0$0yn={1RgbSDEJz1@D#"
    "_0ql{8sxVPu13j+S1iT$qO4&7Q2ZJO3mZRPNUA#7N4Ukb*q&jq%XV1Y89zwdZnDaLC<>rXpiu(%K!+TJ27D<IK9+p)0KT5"
    "Jm^1FG`@18&Rh-OyIdFLC+-&7(ie=!J|I>z5Ey<O^kU-y`Zn)694i|Um2z=MXKre1EJ+-^8>lc<J)P4Kyxv*&HL!x`}s=y"
    "Da<G%NpRX?-K7tmaw1ZEBjPCtS~5IDO2)S_@04%-Y4}vfB+8bR{@9<NYX~@?nRw0e*qFsPM2rmwj?Py-)P`u7tGrG<6OS3"
    "y3S|x`bYTkXQXIFXvH8^4U<6EvWJo<HCh)st07GWo7No#ir)g)-^T%*FXB@-?z`sp3#%yeG$j4dp7X=No$XDq4x`Fx(6pA"
    "h?$wup_carPcA#le91X;xv;9S`b}CWE;=Ez^q-b*Bfn=R#zy{Y|B!avQER;N!sP5$jhzgW4JDBwenBDO*Y3pMyAyHi+PMH"
    "5mp!bL$>(iOg<bS<*4;Al>Xx&<$_{A}5fQO1JeZM@wx+a<=lL6+*VL62L^<g4&()-O9pD-JT#=s`72p$OZEbK+l!=c`igl"
    "u^<d%yj&v5nqAOi{Hr_!6g=37{QcUM2ox)NrGbCp3gCOD~Lf0RagsR=K9dmZOyDZg#5yRahG^T=Ld;Y-_FW6U@Ftcdg7%l"
    "50j{JMv!#5!pI+l<@J4!XO3F*aI_MQBbx4Km~(YkL;wVJ^RUey||a)j(R5tFOJFBjPL}jIZpp7V7=o3zjk*qi>3DUvoOKS"
    "6UMD@%$Axe+xaatJtf`b0s)S$%)3w2WO6HsIs#S_Ewc<M<rOP%HcVHVLx=5t>|z;e31Rl%{;6?^^>&gIfn8g9Q+)Z#=@*P"
    "qi&}S)hYg#a<et{naKf1tW8yS4z3p@jAY#pefZ#%Yl&L(xjhpt<&jr?^yEd@fuCLZFP}F&ib^lZzNvd5So<&K4~aWJy{3*"
    "~yF6dq@`HUfeNbZq4s%_p*3fjP_pbTn`iuR_*M*W~I{O3U@5`x`IW|d%VWVmEtW9nPar=;M4fk$FSK%Pt0{<SiwN8v=9Tq"
    ">M^c4aL^a|=fEQ4r&ddtZ_s64~i!OO_AE=EdyIuPru;EuuuSB+oxJI~uw?0ag<*X)Mus^)Ub_!{o39k1ivQ*2TB?;cMA@="
    "TWNK4ynmssbH7Z!W7og-dNeU?2OO)6EROBk9q*zRcZNZ)w=a(#Qb4t&ow=Z*A0#^~`l1TI_z>-1Ydy7M+u78+PWoE3@^#N"
    ")A1$BLJO-{afO6^h8Ge-pZ=E+$xBnbQG^aQ-q<|@21DmCrp&Y&^<%hg%7(OBGAb*&<PGcROL48k?*Ol210~y6$$RvitDD<"
    "fBD)n{pNY%@5C_Wnd)+-N%4zZjn|yyxPR6?2{~pa25)O^DQ<et3~@9w7a6$aJ3Ov_PoyjPjI0o5v^LIJUs?*&)>={%3^5-"
    "p_2iD?c_;Z@@QKQg5?3kdq1Oc&b|!+;!>vPa0fb5Hwl0@?ne@H!HF|e<tgG+`km#C>o7(%C1d$D0_Goe0cLv46=iY5RkvF"
    "g2x{meBi(|mccy~|Dqrc`qrZz%{7u>#SJ{;mRyYUe&X6$V!7@J`)*8MEPTa0gFgy}n>@EPyvChVcumwl{qw)bB?&aaOR(_"
    "wE<JZ^Xz+0*%XJT$cU*WTC~K)}E|rL>*EfR@5?87fJ#)s*c&C^Rz#+b4P`rV&u^eAN0AE2?bjaQVVD-0iHQS7iw}+%eWp1"
    "flt-pm9XQ&{ie;i}96>z4IKr8$~1~Wz<E**2^i0;qRXg&-%=y<(Keo3NNQ%a?0guLT+(hc|~<qZQJLLPM8Wim&WPje+W`W"
    "?sqerzreY8#WW8%+q=3(gkOvZk0Vs4q%|x^THx{qU;@gAd@m(eHua1{IR&H?OkKUtW<#wMb)BOt2l<pOqKeu^8HLo1T>`J"
    ")&3g0S@C2u%GY&e~{4YV=<YG$W_<CtWkEpDQj!6zl9oMr_X|>%LwaarigCnvUrZ%dd2uXhXoxr`z?9}bdw_g!kwOu1h2G-"
    "l*H5B&Q1}0VXENoIWb&tuZ>4R)kvp#d@)i+KJ@8rH6Fcv0GF-=RqTX|KTvz*)a+4#plX&U8LIUe!kKb~W0Xvp};B$9W#n$"
    "d}XXs|)|PP0pBpTuR<P6(Mr)pNLih5oJnv47D`xM6GR;xc>;YY`j*0$j|%>I4HjHy0Z-3ISVXr3fZgHZ~R}Gyq?jfTEbNE"
    "G!sCG=PA?perB<G!q7cVPZrh!S@sBasrNIU}R!uVq`!O-%XZz5MTfb&A`aW$bd$XUtXYeCIlz~2?AiCNdVbmi6B7X00^K#"
    "8I2+X6aq@oVF(Za36f3)76}3b1}6ceAio;X5@0^414twl0LTE9Am-BmND8n>K%hhe5`ZMCivWcHcbIGdAQuBzw1AUzvH?J"
    "+Q!U6k$>0wM5`iFIpQzJ2ED?12G7A8p=qmuoC4Ciu7$ljfF9N_H`cnQ%06Cv(KmlkF8lBbx_=`@JQBVp1Tg3oMYd{B(3HV"
    ">?8;W3BQzt;?7@09FtgGoT1Pp>F;0fzEc=-4>ub{(8B>^5aJOP3i6cX7gu~U{#Cml`Fp#$IuI1~<@Uyzem-Lvn&K^+L>IG"
    "B&5mKO?5JfZ*!{E09)9s)-kwU{HGeq#NB1xjQ{WkfWCgZ%&?AfS}$0l%i`;OC`60WXMHEDkg!$Ynw<H2^_5xg>yGrDOy}("
    "WzUFS{CF>EZqy#3JC4JS|*aqb?K}v^QVs$7O;l62%y%8<tq8NFXf}wPG9V7tLZeGzT(o+^uV9L8A-kAX!=Czz5>)!L7xuL"
    "=qs30Mez1AP}OCrq*_BP9tL__ib~We;&KT=Jba5id6`IVuqe82xtIp0#$vms$)SzE&3_1V?MDPS0S|U?C}K4o4UQlX!IRq"
    "O3KSLq{XqhcClCk_Vj+P$M*Dt&B9A$8fbE84$^cd~_y>Lj(D3C$8%i9DAc{s32w*Ruj#7#T*i?vf4V+!z_jmw}Se)r39Zy"
    "^@1WLXZF(06PE+Bj0iR*=s)&uq*fPUx`C_Z@7)u3R1LHzMlKv)WJ2NA?ZLo@Q1EJy%xd;;_j1&bC$l007*0eXVCM)H9C(}"
    "9{#fKW#y?PCQMA^k%rLxc*@8W4Xa>6B3C5G??q>;mN=Eya=p9=}A;LR1Gl1)yQ*rq9B{0u8c^A}lOW2^xlG`xhv&8Zu7|T"
    "7sT}%+D_obPVP8&w)XQ&_G0BZf=QKVwQk8YOIKm{r^Pf7YPDnc6N4dC58e({s))PEBp"
)
